"""The files of which a dataset consists, as the disk or the bucket lists them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

from handsight.datasets.address import Location, S3Prefix
from handsight.datasets.errors import StorageError, headline
from handsight.datasets.machine import said_by
from handsight.datasets.store.buckets import bucket_endpoint, bucket_region

if TYPE_CHECKING:
    from pyarrow.fs import S3FileSystem


def stored_files(location: Location, folder: str = "", *, leave_out: str = "") -> dict[str, int]:
    """Bytes of every file in a folder of a dataset, by its path in there, at whatever depth.

    In a bucket that is one request for a thousand files.

    Args:
        location: The dataset.
        folder: The folder in it, such as ``refs``; without it, the whole dataset.
        leave_out: A folder in that one that is not looked into.

    Raises:
        StorageError: The disk or bucket cannot be read.
    """
    if isinstance(location, S3Prefix):
        return _in_bucket(location, folder)
    return _on_disk(location / folder, leave_out)


def _on_disk(root: Path, leave_out: str) -> dict[str, int]:
    def refuse(error: OSError) -> None:
        if not isinstance(error, FileNotFoundError):
            cause, remedy = said_by(error) or (error.strerror, "check that it can be read")
            raise StorageError(f"cannot list {error.filename}: {cause}; {remedy}") from error

    found = {}
    base = str(root)
    for parent, folders, names in os.walk(base, onerror=refuse):
        if parent == base and leave_out in folders:
            folders.remove(leave_out)
        # Text, not paths: a picture is four files, and a hundred thousand of them shall not take a second.
        inside = parent[len(base) + 1 :]
        for name in names:
            found[f"{inside}/{name}" if inside else name] = _size(f"{parent}/{name}")
    return found


def names_in(location: Location, folder: str) -> list[str]:
    """Names of the files in a folder of a dataset, sorted; none where there is no such folder.

    Raises:
        StorageError: The disk or bucket cannot be read.
    """
    return sorted(name for name in stored_files(location, folder) if "/" not in name)


def write_object(location: S3Prefix, name: str, content: bytes) -> None:
    """Put an object into a bucket, in place of one that may be there.

    Raises:
        StorageError: The bucket is not within reach, or may not be written.
    """
    with (
        _bucket_errors(f"cannot write {name} of {location}"),
        _bucket().open_output_stream(_key(location, name)) as stream,
    ):
        stream.write(content)


def read_object(location: S3Prefix, name: str) -> bytes:
    """What an object of a bucket holds.

    Raises:
        StorageError: It is not there, or the bucket is not within reach.
    """
    with (
        _bucket_errors(f"cannot read {name} of {location}"),
        _bucket().open_input_stream(_key(location, name)) as stream,
    ):
        content: bytes = stream.read()
    return content


def remove_object(location: S3Prefix, name: str) -> None:
    """Take an object out of a bucket; it need not be there.

    Raises:
        StorageError: The bucket is not within reach, or may not be written.
    """
    with _bucket_errors(f"cannot remove {name} of {location}"), suppress(FileNotFoundError):
        _bucket().delete_file(_key(location, name))


def _in_bucket(location: S3Prefix, folder: str) -> dict[str, int]:
    from pyarrow.fs import FileSelector, FileType

    root = _key(location, folder)
    with _bucket_errors(f"cannot list the files of {location}"):
        listed = _bucket().get_file_info(FileSelector(root, recursive=True, allow_not_found=True))
    return {one.path.removeprefix(f"{root}/"): one.size for one in listed if one.type == FileType.File}


def _key(location: S3Prefix, name: str) -> str:
    return "/".join(filter(None, (location.bucket, location.prefix, name)))


def _bucket() -> S3FileSystem:
    """The buckets that the environment tells of, as for Icechunk, which has no call that lists files or writes one."""
    # Only who looks at a bucket pays for the import.
    from pyarrow.fs import S3FileSystem

    endpoint = bucket_endpoint()
    return S3FileSystem(
        region=bucket_region(),
        endpoint_override=endpoint,
        proxy_options=_proxy(endpoint or "https://amazonaws.com"),
    )


@contextmanager
def _bucket_errors(action: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StorageError(f"{action}: {headline(error)}; check that the bucket is within reach") from error


def _proxy(url: str) -> str | None:
    """The proxy that the environment names for a server, which Icechunk heeds by itself."""
    server = urlsplit(url)
    return None if proxy_bypass(server.hostname or "") else getproxies().get(server.scheme)


def _size(file: str) -> int:
    """0 for a file that went away since it was listed: a writer at work renames its files when they are whole."""
    try:
        return Path(file).stat().st_size
    except FileNotFoundError:
        return 0
