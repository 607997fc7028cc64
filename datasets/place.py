"""Where a dataset lies: in a local folder, or under a prefix of an S3 bucket."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

import icechunk

from handsight.datasets.errors import AddressError

_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):/")
_BUCKET = re.compile(r"[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]")


@dataclass(frozen=True, slots=True, kw_only=True)
class S3Prefix:
    """The objects of a bucket whose names begin with ``prefix/``."""

    bucket: str
    prefix: str

    def __str__(self) -> str:
        return f"s3://{self.bucket}/{self.prefix}"


Place = Path | S3Prefix


def place_of(text: str | Place) -> Place:
    """The place that a path or an ``s3://bucket/prefix`` names.

    Raises:
        AddressError: It is a URL of another kind, or has no bucket or prefix.
    """
    if isinstance(text, S3Prefix):
        return text
    scheme = _SCHEME.match(str(text))
    if scheme is None:
        return Path(text)
    # A Path has swallowed one of the slashes.
    bucket, _, prefix = str(text)[scheme.end() :].lstrip("/").partition("/")
    prefix = prefix.strip("/")
    parts = prefix.split("/")
    if scheme[1] != "s3" or not _BUCKET.fullmatch(bucket) or {"", ".", ".."} & set(parts):
        raise AddressError(f"dataset address is '{text}', expected a folder or s3://BUCKET/PREFIX")
    return S3Prefix(bucket=bucket, prefix=prefix)


def storage_at(place: Place) -> icechunk.Storage:
    """Icechunk's view of a place; it creates a folder where there is none.

    A bucket is reached as other tools reach it: by ``AWS_ENDPOINT_URL``, ``AWS_REGION`` and the credentials that the
    environment or the machine provides.
    """
    if isinstance(place, S3Prefix):
        endpoint = os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL") or None
        return icechunk.s3_storage(
            bucket=place.bucket,
            prefix=place.prefix,
            region=os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION") or "us-east-1",
            endpoint_url=endpoint,
            allow_http=endpoint is not None and endpoint.startswith("http://"),
            # Servers other than Amazon's seldom answer for BUCKET.HOST.
            force_path_style=endpoint is not None,
            from_env=True,
        )
    # It warns that local commits are unsafe; ours hold the dataset's lock.
    icechunk.set_logs_filter("warn,icechunk::storage::object_store=error")
    return icechunk.local_filesystem_storage(str(place.resolve()))


def cache_folder() -> Path:
    """Where caches of datasets that are not local folders go: ``$HANDSIGHT_CACHE`` or ``~/.cache/handsight``."""
    chosen = os.environ.get("HANDSIGHT_CACHE")
    return Path(chosen) if chosen else Path.home() / ".cache" / "handsight"
