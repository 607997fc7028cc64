"""Reading a version for long while others may expire it and collect its files as garbage.

A reader registers as writers do (writers.py), with the version that it reads, and expiry and collection leave that
alone. It may have no right to write where the dataset lies, and somebody else may delete with another program; then it
is told that the version was removed, and not that it is damaged.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from handsight.datasets.errors import AddressError, CorruptDataError, StorageError, VersionRemovedError
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.store.writers import register_reader


@contextmanager
def being_read(repository: GraspRepository, snapshot_id: str, what: str) -> Iterator[None]:
    """While the block runs, the version is kept by whoever collects garbage or expires commits.

    Args:
        repository: The dataset.
        snapshot_id: The version that is read.
        what: What is done with it, for people.

    Raises:
        VersionRemovedError: It was removed all the same.
    """
    registration = None
    with suppress(
        CorruptDataError, StorageError, AddressError
    ):  # Who may only read, or has no home, does so unregistered.
        registration = register_reader(repository, snapshot_id, what)
    try:
        with unless_removed(repository, snapshot_id):
            yield
    finally:
        if registration is not None:
            registration.close()


@contextmanager
def unless_removed(repository: GraspRepository, snapshot_id: str) -> Iterator[None]:
    """Where the block cannot read a version that is no longer there, say so instead of calling it damaged.

    Raises:
        VersionRemovedError: It is no longer there.
    """
    try:
        yield
    except (CorruptDataError, StorageError) as error:
        refuse_removed(repository, snapshot_id, cause=error)
        raise


def refuse_removed(repository: GraspRepository, snapshot_id: str, *, cause: Exception | None = None) -> None:
    """Refuse to take for damage what is wrong with a version that has been removed.

    Raises:
        VersionRemovedError: It is no longer there.
    """
    if not repository.is_stored(snapshot_id):
        raise VersionRemovedError(
            f"version {snapshot_id} of {repository.path} was removed by gc while it was being read: start again, from "
            "a release or from what the branch is now"
        ) from cause
