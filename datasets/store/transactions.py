"""Work on a transaction that is begun again where the version under it has been taken away.

Whoever commits after others needs the version that its transaction began from, to see what has changed since. A version
that no name leads to may be expired and its files deleted, by another program than handsight or from another machine
than the lock reaches; then the same changes are made to the new tip, which is what they were meant for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import icechunk

from handsight.datasets.errors import CorruptDataError, StorageError
from handsight.datasets.store.repository import GraspRepository

TRIES = 10

T = TypeVar("T")


def on_the_tip(repository: GraspRepository, branch: str, work: Callable[[icechunk.Session], T]) -> T:
    """``work(transaction)``, which commits; called again from the new tip when it fails and the branch has moved.

    Raises:
        StorageError: It failed although nobody moved the branch, or again and again.
        Exception: Whatever else the work raises.
    """
    for tries_left in range(TRIES - 1, -1, -1):
        transaction = repository.writable(branch)
        base = transaction.snapshot_id
        try:
            return work(transaction)
        except (StorageError, CorruptDataError):
            if not tries_left or repository.tip(branch) == base:
                raise
    raise AssertionError("the last try returns or raises")
