"""The few files of a store that are read and written beside Icechunk, on a disk or in a bucket.

Icechunk lists neither snapshots nor the traces of deleted names, and puts back no name that is damaged.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from handsight.datasets.address import Location, S3Prefix
from handsight.datasets.errors import StorageError, headline

if TYPE_CHECKING:
    from pyarrow.fs import S3FileSystem


def names_in(path: Location, folder: str) -> list[str]:
    """Names of the files in a folder of a store, sorted; none where there is no such folder.

    Raises:
        StorageError: The disk cannot be read, or the bucket is not within reach.
    """
    with _storage_errors(f"cannot list {folder} of {path}"):
        if not isinstance(path, S3Prefix):
            return sorted(one.name for one in (path / folder).iterdir()) if (path / folder).is_dir() else []
        from pyarrow.fs import FileSelector

        selector = FileSelector(f"{path.bucket}/{path.prefix}/{folder}", allow_not_found=True)
        return sorted(one.base_name for one in _bucket().get_file_info(selector))


def write_object(path: S3Prefix, name: str, content: bytes) -> None:
    """Put an object into a bucket, in place of one that may be there.

    Raises:
        StorageError: The bucket is not within reach, or may not be written.
    """
    target = f"{path.bucket}/{path.prefix}/{name}"
    with _storage_errors(f"cannot write {name} of {path}"), _bucket().open_output_stream(target) as stream:
        stream.write(content)


def _bucket() -> S3FileSystem:
    """The buckets that the environment tells of, as for Icechunk (icechunk_engine.py)."""
    from pyarrow.fs import S3FileSystem

    endpoint = os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL") or None
    scheme, _, host = (endpoint or "").rpartition("://")
    return S3FileSystem(
        region=os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION") or "us-east-1",
        endpoint_override=host or None,
        scheme=scheme or "https",
    )


@contextmanager
def _storage_errors(action: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"{action}: {error.strerror or headline(error)}; check that the disk is readable, or that the bucket is "
            "within reach"
        ) from error
