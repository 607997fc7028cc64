"""How a version of a dataset is named, ``PATH`` or ``PATH@REF``, and where its dataset lies.

In a local folder, or under a prefix of an S3 bucket (``s3://BUCKET/PREFIX``).
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from handsight.datasets.errors import AddressError, DatasetNotFoundError, NotADatasetError, pasteable

DEFAULT_REF = "main"
"""The branch that is read where the address names no ref."""
SIDE_FOLDER = ".handsight"
"""Folder inside a local dataset for what is not part of any version: the lock and caches."""

_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):/")


@dataclass(frozen=True, slots=True, kw_only=True)
class S3Prefix:
    """The objects of a bucket whose names begin with ``prefix/``."""

    bucket: str
    prefix: str

    def __str__(self) -> str:
        return f"s3://{self.bucket}/{self.prefix}"


Location = Path | S3Prefix


def location_of(text: str | Location) -> Location:
    """The location that a path or an ``s3://bucket/prefix`` names; ``~`` is the home folder, as in a shell.

    Raises:
        AddressError: It is a URL of another kind, breaks a rule of buckets, or names a home folder there is not.
    """
    if isinstance(text, S3Prefix):
        return text
    scheme = _SCHEME.match(str(text))
    if scheme is None:
        return _folder(text)
    if scheme[1].lower() != "s3":
        raise AddressError(
            f"dataset address is '{text}', and {scheme[1]}:// is not known: expected a folder or s3://BUCKET/PREFIX"
        )
    # A Path has swallowed one of the slashes.
    bucket, _, prefix = str(text)[scheme.end() :].lstrip("/").partition("/")
    prefix = prefix.strip("/")
    faults = [*_bucket_faults(bucket), *_prefix_faults(prefix)]
    if faults:
        raise AddressError(f"dataset address is '{text}', expected a folder or s3://BUCKET/PREFIX: {'; '.join(faults)}")
    return S3Prefix(bucket=bucket, prefix=prefix)


def _folder(text: str | Path) -> Path:
    if "\0" in str(text):
        raise AddressError(f"dataset address is {str(text)!r}, expected a path without NUL")
    if isinstance(text, Path) or not text.startswith("~"):
        return Path(text)  # A Path does not know any more whether it was written as ./~ .
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        raise AddressError(
            f"dataset address is {str(text)!r}, and there is no such home folder: write the path in full, or ./~ for a "
            "folder of that name"
        ) from error


def _bucket_faults(bucket: str) -> list[str]:
    """The rules of names of buckets that one breaks."""
    if not bucket:
        return ["the bucket is missing"]
    rules = (
        (3 <= len(bucket) <= 63, f"has 3 to 63 characters, and {bucket!r} has {len(bucket)}"),
        (
            re.fullmatch(r"[a-z0-9.-]*", bucket),
            f"holds lower-case letters, digits, '-' and '.' alone, unlike {bucket!r}",
        ),
        (
            re.fullmatch(r"[a-z0-9].*[a-z0-9]|.", bucket, re.DOTALL),
            f"begins and ends with a letter or digit, unlike {bucket!r}",
        ),
        (".." not in bucket, f"holds no two dots in a row, unlike {bucket!r}"),
    )
    return [f"a bucket's name {rule}" for kept, rule in rules if not kept]


def _prefix_faults(prefix: str) -> list[str]:
    if not prefix:
        return ["the prefix behind the bucket is missing"]
    odd = sorted({"", ".", ".."} & set(prefix.split("/")))
    return [f"the prefix {prefix!r} holds the part {odd[0]!r}"] if odd else []


def refuse_unreachable(location: Location) -> None:
    """Refuse a new dataset whose name ``PATH@REF`` would take apart, so that nobody could open it.

    Raises:
        AddressError: The last part of the path holds an ``@``.
    """
    name = location.prefix.rpartition("/")[2] if isinstance(location, S3Prefix) else location.name
    if "@" in name:
        raise AddressError(
            f"a new dataset cannot be called {name!r}: what follows '@' names a version; choose a name without '@'"
        )


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
        stripped = text.rstrip("/")
        if _SCHEME.match(text) and not _SCHEME.match(stripped):
            location_of(text)  # It has no bucket, and without its slashes would look like a folder.
        parent, slash, last = stripped.rpartition("/")
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
    if isinstance(location, S3Prefix):
        return DatasetNotFoundError(
            f"there is no dataset at {location}: create it with {pasteable('handsight', 'dataset', 'init', location)}"
        )
    if location.is_symlink() and not location.exists():
        return DatasetNotFoundError(
            f"{location} is a link to {location.readlink()}, which is not there: mend the link, or remove it"
        )
    if not location.exists():
        return DatasetNotFoundError(
            f"there is no dataset at {location}: create it with {pasteable('handsight', 'dataset', 'init', location)}"
        )
    kind = "a folder that is no dataset" if location.is_dir() else "a file"
    return NotADatasetError(f"{location} is {kind}, expected a dataset folder: check the path")


def cache_folder() -> Path:
    """Where caches of datasets that are not local folders go: ``$HANDSIGHT_CACHE`` or ``~/.cache/handsight``.

    Raises:
        AddressError: The user has no home folder, as in some containers.
    """
    chosen = os.environ.get("HANDSIGHT_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    try:
        return Path.home() / ".cache" / "handsight"
    except RuntimeError as error:
        raise AddressError("this user has no home folder for caches: set HANDSIGHT_CACHE to a folder") from error
