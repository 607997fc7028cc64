"""How a version of a dataset is named, ``PATH`` or ``PATH@REF``, and where its dataset lies.

In a local folder, or under a prefix of an S3 bucket (``s3://BUCKET/PREFIX``).
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from handsight.datasets.errors import AddressError, DatasetNotFoundError, NotADatasetError

DEFAULT_REF = "main"
"""The branch that is read where the address names no ref."""

_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):/")
_BUCKET = re.compile(r"[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]")


@dataclass(frozen=True, slots=True, kw_only=True)
class S3Prefix:
    """The objects of a bucket whose names begin with ``prefix/``."""

    bucket: str
    prefix: str

    def __str__(self) -> str:
        return f"s3://{self.bucket}/{self.prefix}"


Location = Path | S3Prefix


def location_of(text: str | Location) -> Location:
    """The location that a path or an ``s3://bucket/prefix`` names.

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


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetAddress:
    """Where a dataset is and the version of it that is meant."""

    path: Location
    """The folder of the dataset, or its location in a bucket."""
    ref: str = DEFAULT_REF
    """A release, a branch or a snapshot id, looked up in this order."""

    @classmethod
    def parse(cls, text: str) -> DatasetAddress:
        """Read ``PATH[@REF]``.

        Only the last component of the path is split, at its last ``@``, so parent folders may contain the sign.

        Raises:
            AddressError: The path or the ref is empty, or the text is a URL of another kind than ``s3://``.
        """
        parent, slash, last = text.rstrip("/").rpartition("/")
        name, ref = last.rsplit("@", 1) if "@" in last else (last, DEFAULT_REF)
        if not ref:
            raise AddressError(f"dataset address {text!r} ends in '@': name a release, branch or snapshot, or drop it")
        if not name:
            raise AddressError(f"dataset address is {text!r}, expected PATH or PATH@REF with a folder name in PATH")
        return cls(path=location_of(parent + slash + name), ref=ref)

    def __str__(self) -> str:
        return f"{self.path}@{self.ref}"


def looks_like_dataset(location: Location) -> bool:
    """Whether a dataset can be there, as far as can be told without Icechunk: in a bucket always."""
    return isinstance(location, S3Prefix) or (location / "refs").is_dir()


def check_dataset_folder(location: Location) -> None:
    """Refuse a local path where no dataset can be, before Icechunk is imported; what is in a bucket is not asked.

    Raises:
        DatasetNotFoundError: Nothing is there.
        NotADatasetError: The path is a file or a folder that is no dataset.
    """
    if not looks_like_dataset(location):
        raise no_dataset_at(location)


def no_dataset_at(location: Location) -> DatasetNotFoundError | NotADatasetError:
    """The error of a location at which there is no dataset."""
    if isinstance(location, S3Prefix) or not location.exists():
        return DatasetNotFoundError(
            f"there is no dataset at {location}: create it with 'handsight dataset init {location}'"
        )
    kind = "a folder that is no dataset" if location.is_dir() else "a file"
    return NotADatasetError(f"{location} is {kind}, expected a dataset folder: check the path")


def cache_folder() -> Path:
    """Where caches of datasets that are not local folders go: ``$HANDSIGHT_CACHE`` or ``~/.cache/handsight``."""
    chosen = os.environ.get("HANDSIGHT_CACHE")
    return Path(chosen) if chosen else Path.home() / ".cache" / "handsight"
