"""Everything handsight asks of Icechunk and Zarr beyond their own calls: set-up, durable commits, named errors."""

from __future__ import annotations

import asyncio
import ctypes
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import icechunk
import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.core.sync import sync
from zarr.errors import ZarrUserWarning

from handsight.datasets.errors import CorruptDataError, StorageError
from handsight.datasets.place import Place, S3Prefix, storage_at
from handsight.datasets.refs import move_branch

_NUMCODECS_NOTICE = "Numcodecs codecs are not in the Zarr version 3 specification"
warnings.filterwarnings("ignore", _NUMCODECS_NOTICE, ZarrUserWarning)
"""Pictures are stored with one of them (schema.py). Zarr says so whenever an array is opened, in a thread of its own,
where only a filter of the whole process reaches it."""

_MANIFEST_CHUNKS = 1024
"""Chunk references in one manifest. A commit rewrites the last manifest of each array, so without a limit the cost of a
commit grows with the length of the session."""

READ_FAILURES = (ValueError, TypeError, RuntimeError, OSError, KeyError, icechunk.IcechunkError)
"""What zarr, the codecs and Icechunk raise for bytes that are damaged or missing."""


def local_storage(path: Path) -> icechunk.Storage:
    """Icechunk's view of a local folder, which it creates where there is none."""
    return storage_at(path)


def engine_config() -> icechunk.RepositoryConfig:
    """The settings that every new dataset is created with and keeps."""
    splitting = icechunk.ManifestSplittingConfig.from_dict(
        {icechunk.ManifestSplitCondition.AnyArray(): {icechunk.ManifestSplitDimCondition.Axis(0): _MANIFEST_CHUNKS}}
    )
    config = icechunk.RepositoryConfig.default()
    config.manifest = icechunk.ManifestConfig(splitting=splitting)
    return config


@contextmanager
def engine_errors(action: str) -> Iterator[None]:
    """Turn failures of the engine into ``StorageError``; ``action`` says what was being done."""
    try:
        yield
    except icechunk.IcechunkError as error:
        advice = "check that the disk is writable and not full, or that the bucket is within reach"
        raise StorageError(f"{action}: {_headline(error)}; {advice}") from error


def publish(
    repository: icechunk.Repository,
    session: icechunk.Session,
    *,
    root: Path,
    branch: str,
    message: str,
    metadata: Mapping[str, Any],
) -> str:
    """Move the branch to a new snapshot with the session's changes, and return its id. The caller holds the lock.

    What the snapshot needs is on the disk before the branch points to it, and the branch is before this returns, so
    a power cut leaves either the old version or the new one, whole. Icechunk itself never syncs (refs.py).

    Raises:
        icechunk.RebaseFailedError: The branch has moved and its new commits touch what the session touched.
    """
    tip = repository.lookup_branch(branch)
    if session.snapshot_id != tip:
        session.rebase(icechunk.ConflictDetector())
    snapshot_id = session.flush(message, dict(metadata))
    sync_file_system(root)
    move_branch(root, branch, snapshot_id)
    return snapshot_id


def publish_shared(
    repository: icechunk.Repository,
    session: icechunk.Session,
    *,
    branch: str,
    message: str,
    metadata: Mapping[str, Any],
    check: Callable[[str], None],
) -> str:
    """As :func:`publish` for an object store, where no lock reaches and the store itself refuses a stale move.

    Whoever is refused starts again from the new tip, of which ``check`` is told each time.

    Raises:
        icechunk.RebaseFailedError: The branch has moved and its new commits touch what the session touched.
    """
    while True:
        tip = repository.lookup_branch(branch)
        check(tip)
        if session.snapshot_id != tip:
            session.rebase(icechunk.ConflictDetector())
        if session.snapshot_id != tip:
            continue
        try:
            return session.commit(message, dict(metadata))
        except icechunk.ConflictError:
            continue


def sync_file_system(path: Place) -> None:
    """Wait until everything written to the file system under ``path`` is on the disk.

    An object store acknowledges only what is durable, so there is nothing to wait for.

    One call for the file system, because Icechunk does not say which files it wrote; a few milliseconds when little
    else is being written. Where there is no ``syncfs``, all file systems are synced.
    """
    if isinstance(path, S3Prefix):
        return
    libc = ctypes.CDLL(None, use_errno=True)
    if not hasattr(libc, "syncfs"):
        os.sync()
        return
    folder = os.open(path, os.O_RDONLY)
    try:
        if libc.syncfs(folder) != 0:
            code = ctypes.get_errno()
            raise StorageError(f"cannot sync {path} to disk: {os.strerror(code)}; the commit may not survive a crash")
    finally:
        os.close(folder)


def group_at(parent: zarr.Group, path: str) -> zarr.Group:
    """The group at a path.

    Raises:
        CorruptDataError: There is none.
    """
    node = _node(parent, path)
    if not isinstance(node, zarr.Group):
        raise CorruptDataError(f"{_name(parent, path)} is an array, expected a group")
    return node


def array_at(parent: zarr.Group, path: str) -> zarr.Array[Any]:
    """The array at a path.

    Raises:
        CorruptDataError: There is none.
    """
    node = _node(parent, path)
    if not isinstance(node, zarr.Array):
        raise CorruptDataError(f"{_name(parent, path)} is a group, expected an array")
    return node


def read_rows(array: zarr.Array[Any], start: int, stop: int) -> NDArray[Any]:
    """Rows ``start`` to ``stop``, the latter excluded.

    Raises:
        CorruptDataError: Their bytes fail the checksum or are missing.
    """
    try:
        return np.asarray(array[start:stop])
    except READ_FAILURES as error:
        rows = f"row {start}" if stop == start + 1 else f"rows {start} to {stop - 1}"
        raise CorruptDataError(
            f"{array.path} is damaged in {rows}: {_headline(error)}; restore the dataset from a copy"
        ) from error


def append_rows(array: zarr.Array[Any], rows: NDArray[Any]) -> None:
    """Add rows to the end of an array."""
    end_with([(array, array.shape[0], rows)])


def end_with(blocks: Sequence[tuple[zarr.Array[Any], int, NDArray[Any]]]) -> None:
    """Let arrays end with a block each, from the row given on; what an array had from there is gone.

    All at a time: a commit writes to two dozen arrays, and one after the other would take half as long again.
    """
    sync(_end_with(blocks))


async def _end_with(blocks: Sequence[tuple[zarr.Array[Any], int, NDArray[Any]]]) -> None:
    async def write(array: zarr.Array[Any], start: int, rows: NDArray[Any]) -> None:
        await array.async_array.resize((start + len(rows), *array.shape[1:]))
        await array.async_array.setitem(slice(start, None), rows)

    # All are waited for, whatever fails, so that nothing is written behind the back of whoever handles the error.
    outcomes = await asyncio.gather(*(write(*block) for block in blocks), return_exceptions=True)
    for outcome in outcomes:
        if outcome is not None:
            raise outcome


def copy_group(source: zarr.Group, parent: zarr.Group, name: str) -> None:
    """Copy a group with everything in it to a place where there is nothing yet, chunk by chunk.

    Raises:
        CorruptDataError: Some of it is damaged.
    """
    try:
        target = parent.create_group(name, attributes=source.attrs.asdict())
        for path, node in sorted(source.members(max_depth=None)):
            if isinstance(node, zarr.Group):
                target.create_group(path, attributes=node.attrs.asdict())
            else:
                # It keeps chunks and codecs by itself, but neither of these.
                kept = {"fill_value": node.fill_value, "attributes": node.attrs.asdict()}
                zarr.from_array(target.store, data=node, name=f"{target.path}/{path}", **kept)
    except READ_FAILURES as error:
        raise CorruptDataError(f"{_name(source, '')} cannot be copied: {_headline(error)}") from error


def _node(parent: zarr.Group, path: str) -> zarr.Group | zarr.Array[Any]:
    try:
        return parent[path]
    except READ_FAILURES as error:
        raise CorruptDataError(f"{_name(parent, path)} cannot be read: {_headline(error)}") from error


def _name(parent: zarr.Group, path: str) -> str:
    return f"{parent.path}/{path}".lstrip("/")


def _headline(error: Exception) -> str:
    """The first line of the message; Icechunk adds a Rust backtrace below it."""
    lines = [line.strip(" x×") for line in str(error).splitlines() if line.strip(" x×")]
    return lines[0] if lines else type(error).__name__
