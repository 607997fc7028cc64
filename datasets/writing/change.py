"""One commit made of what the tip of a branch holds: read, decide, write, with nobody in between."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import zarr

from handsight.datasets.errors import SessionConflictError
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.icechunk_engine import icechunk_errors
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.store.transactions import on_the_tip
from handsight.datasets.store.writers import at_work

_TRIES = 100

T = TypeVar("T")

Change = Callable[[GraspDataset, zarr.Group], tuple[str | None, T]]
"""Given the version at the tip and its root to write to, makes its changes and returns the message of the commit, None
when there is nothing to change, and whatever its caller wants to know. It may be called again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Changed(Generic[T]):
    """What became of a change."""

    snapshot: str | None
    """The new tip of the branch; None when there was nothing to change."""
    value: T
    """What the change returned beside the message, when it was made for the last time."""


RootChange = Callable[[str, zarr.Group], tuple[str | None, T]]
"""As :data:`Change`, given the id of the snapshot at the tip instead of the version: for one that may be unreadable."""


def change_branch(repository: GraspRepository, branch: str, change: Change[T]) -> Changed[T]:
    """Commit a change to the tip of a branch, which can be read; see :func:`change_root`.

    Raises:
        CorruptDataError: What describes a session of the tip is damaged.
    """

    def with_version(snapshot_id: str, root: zarr.Group) -> tuple[str | None, T]:
        return change(GraspDataset(repository, ref=snapshot_id), root)

    return change_root(repository, branch, with_version)


def preview_change(repository: GraspRepository, branch: str, change: Change[T]) -> T:
    """What a change to the tip of a branch would come to. Nothing is written and no lock taken, so anybody may ask.

    ``change`` is given a root that cannot be written to: it has to return before it makes its changes.

    Raises:
        RefNotFoundError: There is no such branch.
        CorruptDataError: What describes a session of the tip is damaged.
    """
    dataset = GraspDataset(repository, ref=repository.tip(branch))
    return change(dataset, dataset.root)[1]


def change_root(repository: GraspRepository, branch: str, change: RootChange[T]) -> Changed[T]:
    """Commit a change to the tip of a branch.

    ``change`` runs while no other process of this machine can commit. Where a lock cannot reach, on an object store,
    a change that met another one to the same arrays is made again from the new tip, so neither is lost.

    Raises:
        RefNotFoundError: There is no such branch.
        SessionConflictError: Others kept committing to the same arrays.
        DatasetBusyError: Another process held the commit lock for too long.
    """

    def work(transaction: Any) -> Changed[T]:
        with icechunk_errors(f"cannot write to {repository.path}"):
            message, value = change(transaction.snapshot_id, zarr.open_group(transaction.store, mode="r+"))
        if message is None:
            return Changed(snapshot=None, value=value)
        return Changed(snapshot=repository.commit(transaction, branch=branch, message=message), value=value)

    with repository.locked(), at_work(repository, f"change {branch}"):
        tries_left = _TRIES
        while True:
            try:
                return on_the_tip(repository, branch, work)
            except SessionConflictError:
                tries_left -= 1
                if not tries_left:
                    raise
