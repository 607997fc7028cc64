"""Everything handsight asks of Icechunk beyond its own calls: set-up, durable commits, named errors."""

from __future__ import annotations

import asyncio
import ctypes
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import icechunk
from zarr.core.sync import sync

from handsight.datasets.address import Location, S3Prefix, looks_like_dataset
from handsight.datasets.errors import CorruptDataError, DatasetError, StorageError, headline
from handsight.datasets.machine import cause_and_remedy, shortage
from handsight.datasets.store.buckets import bucket_endpoint, bucket_region
from handsight.datasets.store.refs import move_branch

_MANIFEST_CHUNKS = 1024
"""Chunk references in one manifest. A commit rewrites the last manifest of each array, so without a limit the cost of a
commit grows with the length of the session."""

_OF_DAMAGE = (
    "I/O error",  # A block that cannot be unpacked; what the system says ends in its number.
    "Invalid Icechunk metadata file",
    "Requested range was invalid",
    "cannot serialize ref json",
    "config deserialization",
    "invalid magic numbers",
    "more modern version",
    "no such file or directory",
    "No such file or directory",
    "snapshot not found",
    "the repository doesn't exist",  # Asked only of what is known to be one: it goes by the branch main.
)
"""What Icechunk says where it read a file of its own that is damaged, cut short or missing."""


def storage_at(location: Location) -> icechunk.Storage:
    """Icechunk's view of a location; it creates a folder where there is none.

    A bucket is reached as other tools reach it: by ``AWS_ENDPOINT_URL``, ``AWS_REGION`` and the credentials that the
    environment or the machine provides.

    Raises:
        StorageError: The machine lacks what any read takes.
    """
    # Icechunk panics where it can start no thread.
    if lacking := shortage():
        raise StorageError(f"cannot open {location}: {lacking[0]}; {lacking[1]}")
    if isinstance(location, S3Prefix):
        endpoint = bucket_endpoint()
        return icechunk.s3_storage(
            bucket=location.bucket,
            prefix=location.prefix,
            region=bucket_region(),
            endpoint_url=endpoint,
            allow_http=endpoint is not None and endpoint.startswith("http://"),
            # Servers other than Amazon's seldom answer for BUCKET.HOST.
            force_path_style=endpoint is not None,
            from_env=True,
        )
    # It warns that local commits are unsafe; ours hold the dataset's lock. It prints a page about a manifest that could
    # not be read ahead, and whoever needs the manifest is told so anyway.
    icechunk.set_logs_filter("warn,icechunk::storage::object_store=error,icechunk::repository=off")
    return icechunk.local_filesystem_storage(str(location.resolve()))


def icechunk_config() -> icechunk.RepositoryConfig:
    """The settings that every new dataset is created with and keeps."""
    splitting = icechunk.ManifestSplittingConfig.from_dict(
        {icechunk.ManifestSplitCondition.AnyArray(): {icechunk.ManifestSplitDimCondition.Axis(0): _MANIFEST_CHUNKS}}
    )
    config = icechunk.RepositoryConfig.default()
    config.manifest = icechunk.ManifestConfig(splitting=splitting)
    return config


def open_store(location: Location) -> icechunk.Repository | None:
    """What is stored at a location, ours or not; None where nothing is. Writes nothing.

    Raises:
        StorageError: The disk or bucket cannot be read.
    """
    # Icechunk creates the folder it is asked about, so it is asked only about folders that look like its own.
    if not looks_like_dataset(location):
        return None
    # It would read ahead what it guesses will be wanted, also of versions that are only looked at for their schema.
    config = icechunk.RepositoryConfig()
    config.manifest = icechunk.ManifestConfig(
        preload=icechunk.ManifestPreloadConfig(preload_if=icechunk.ManifestPreloadCondition.false())
    )
    with icechunk_errors(f"cannot open {location}"):
        try:
            return icechunk.Repository.open(storage_at(location), config)
        except icechunk.IcechunkError as error:
            if headline(error).startswith("the repository doesn't exist"):
                return None
            raise


def lookup_branches(repository: icechunk.Repository, names: Iterable[str]) -> dict[str, str]:
    """The snapshot id of each branch; all are asked for at once, because a bucket takes its time for each.

    Raises:
        icechunk.IcechunkError: One of them cannot be read.
    """
    wanted = list(names)

    async def look() -> list[str]:
        return await asyncio.gather(*(repository.lookup_branch_async(name) for name in wanted))

    return dict(zip(wanted, sync(look()), strict=True))


@contextmanager
def icechunk_errors(action: str) -> Iterator[None]:
    """Turn failures of the engine into errors of this room; ``action`` says what was being done.

    Raises:
        StorageError: The machine could not read or write, or Icechunk refused for another reason.
        CorruptDataError: One of the files in which Icechunk keeps its books is damaged or missing.
    """
    try:
        yield
    except icechunk.IcechunkError as error:
        raise engine_error(action, error) from error


def engine_error(action: str, error: icechunk.IcechunkError) -> DatasetError:
    """The error of this room for one of Icechunk's, which has one class for everything."""
    if said := cause_and_remedy(error):
        return StorageError(f"{action}: {said[0]} ({headline(error)}); {said[1]}")
    if any(words in str(error) for words in _OF_DAMAGE):
        advice = "verify with --all names all that is damaged, a copy has it whole"
        return CorruptDataError(f"{action}: {headline(error)}; {advice}")
    advice = "check that the disk is writable and not full, or that the bucket is within reach"
    return StorageError(f"{action}: {headline(error)}; {advice}")


def is_missing_ref(error: icechunk.IcechunkError) -> bool:
    """Whether Icechunk says plainly that there is no branch or tag of the name it was asked for."""
    return headline(error).startswith("ref not found")


def publish(
    repository: icechunk.Repository,
    transaction: icechunk.Session,
    *,
    root: Path,
    branch: str,
    message: str,
    metadata: Mapping[str, Any],
) -> str:
    """Move the branch to a new snapshot with the transaction's changes, and return its id. The caller holds the lock.

    What the snapshot needs is on the disk before the branch points to it, and the branch is before this returns, so
    a power cut leaves either the old version or the new one, whole. Icechunk itself never syncs (refs.py).

    Raises:
        icechunk.RebaseFailedError: The branch has moved and its new commits touch what the transaction touched.
    """
    tip = repository.lookup_branch(branch)
    if transaction.snapshot_id != tip:
        transaction.rebase(icechunk.ConflictDetector())
    snapshot_id = transaction.flush(message, dict(metadata))
    sync_file_system(root)
    move_branch(root, branch, snapshot_id)
    return snapshot_id


def publish_shared(
    repository: icechunk.Repository,
    transaction: icechunk.Session,
    *,
    branch: str,
    message: str,
    metadata: Mapping[str, Any],
    check: Callable[[str], None],
) -> str:
    """As :func:`publish` for an object store, where no lock reaches and the store itself refuses a stale move.

    Whoever is refused starts again from the new tip, of which ``check`` is told each time.

    Raises:
        icechunk.RebaseFailedError: The branch has moved and its new commits touch what the transaction touched.
    """
    while True:
        tip = repository.lookup_branch(branch)
        check(tip)
        if transaction.snapshot_id != tip:
            transaction.rebase(icechunk.ConflictDetector())
        if transaction.snapshot_id != tip:
            continue
        try:
            return transaction.commit(message, dict(metadata))
        except icechunk.ConflictError:
            continue


def sync_file_system(path: Location) -> None:
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
