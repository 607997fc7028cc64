"""The files of which a dataset consists, as the disk or the bucket lists them."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

from handsight.datasets.address import Location, S3Prefix
from handsight.datasets.errors import StorageError, headline
from handsight.datasets.store.buckets import bucket_endpoint, bucket_region


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
            raise StorageError(f"cannot list {error.filename}: {error.strerror}; check that it can be read") from error

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


def _in_bucket(location: S3Prefix, folder: str) -> dict[str, int]:
    # Icechunk has no call that lists files. Only who looks at a bucket pays for the import.
    from pyarrow.fs import FileSelector, FileType, S3FileSystem

    root = "/".join(filter(None, (location.bucket, location.prefix, folder)))
    endpoint = bucket_endpoint()
    try:
        system = S3FileSystem(
            region=bucket_region(),
            endpoint_override=endpoint,
            proxy_options=_proxy(endpoint or "https://amazonaws.com"),
        )
        listed = system.get_file_info(FileSelector(root, recursive=True, allow_not_found=True))
    except OSError as error:
        raise StorageError(
            f"cannot list the files of {location}: {headline(error)}; check that the bucket is within reach"
        ) from error
    return {one.path.removeprefix(f"{root}/"): one.size for one in listed if one.type == FileType.File}


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
