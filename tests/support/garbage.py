"""Deleting what is old beside those who write, by a clock that is two hours ahead: to it nothing is too young."""

from __future__ import annotations

import sys
from datetime import UTC, datetime, timedelta

from handsight.datasets import GraspRepository, collect_garbage, expire
from handsight.datasets.address import Location

AHEAD = timedelta(hours=2)

_IMPORT = """
import sys
from handsight.datasets import import_dataset
source, target = sys.argv[1:]
done = 0
def tell():
    global done
    done += 1
    if done == 16:
        print("half way", flush=True)
        sys.stdin.readline()
print("added", import_dataset(source, target, on_attempt=tell).transfer.attempts)
"""


def waiting_import(source: object, target: object) -> list[str]:
    """The command of an import that says when it is half way, and goes on when it is told a line."""
    return [sys.executable, "-P", "-c", _IMPORT, str(source), str(target)]


def delete_what_is_old(path: str | Location) -> int:
    """Expire and collect what can be; returns how many chunks went."""
    repository = GraspRepository.open(path)
    expire(repository, datetime.now(UTC) + AHEAD, dry_run=False)
    return collect_garbage(repository, datetime.now(UTC) + AHEAD, dry_run=False, grace=-AHEAD).chunks


def delete_unawares(path: str | Location) -> None:
    """As a program would that knows of no writers."""
    engine = GraspRepository.open(path).icechunk_repository
    engine.expire_snapshots(datetime.now(UTC) + AHEAD)
    engine.garbage_collect(datetime.now(UTC) + AHEAD)
