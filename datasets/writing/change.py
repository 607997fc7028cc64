"""One commit made of what the tip of a branch holds: read, decide, write, with nobody in between."""

from __future__ import annotations

from collections.abc import Callable

import zarr

from handsight.datasets.errors import SessionConflictError
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.icechunk_engine import icechunk_errors
from handsight.datasets.store.repository import GraspRepository

_TRIES = 100

Change = Callable[[GraspDataset, zarr.Group], str | None]
"""Given the version at the tip and its root to write to, makes its changes and returns the message of the commit;
None when there is nothing to change."""


def change_branch(repository: GraspRepository, branch: str, change: Change) -> str | None:
    """Commit a change to the tip of a branch and return the snapshot id; None when there was nothing to change.

    ``change`` runs while no other process of this machine can commit. Where a lock cannot reach, on an object store,
    a change that met another one to the same arrays is made again from the new tip, so neither is lost.

    Raises:
        RefNotFoundError: There is no such branch.
        SessionConflictError: Others kept committing to the same arrays.
        DatasetBusyError: Another process held the commit lock for too long.
    """
    with repository.locked():
        tries_left = _TRIES
        while True:
            session = repository.writable(branch)
            dataset = GraspDataset(repository, ref=session.snapshot_id)
            with icechunk_errors(f"cannot write to {repository.path}"):
                message = change(dataset, zarr.open_group(session.store, mode="r+"))
            if message is None:
                return None
            try:
                return repository.commit(session, branch=branch, message=message)
            except SessionConflictError:
                tries_left -= 1
                if not tries_left:
                    raise
