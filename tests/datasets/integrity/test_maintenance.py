"""Old files go without anything that is needed."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.versions import opened

from handsight.datasets import (
    GraspRepository,
    Outcome,
    SessionWriter,
    StorageError,
    collect_garbage,
    create_branch,
    delete_branch,
    expire,
    verify,
)
from handsight.datasets.store.leftovers import WRITERS_FOLDER
from handsight.datasets.store.releases import LEDGER_BRANCH

HEADER = make_header(width=64, height=48)
SIZE = 5


@pytest.fixture
def recorded(repository: GraspRepository) -> GraspRepository:
    attempts = [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(SIZE)]
    record(repository, HEADER, attempts, every=SIZE)
    return repository


def files(repository: GraspRepository) -> set[Path]:
    return {path for path in repository.folder.rglob("*") if path.is_file() and ".handsight" not in path.parts}


def test_nothing_is_deleted_while_nobody_can_tell_who_is_at_work(recorded: GraspRepository) -> None:
    create_branch(recorded, "dev")
    delete_branch(recorded, "dev", force=True)
    entries = recorded.side_folder / WRITERS_FOLDER
    entries.rmdir()
    entries.write_text("no folder")
    before = files(recorded)
    with pytest.raises(StorageError, match=r"cannot list .*writers"):
        collect_garbage(recorded, dry_run=False, grace=timedelta(0))
    with pytest.raises(StorageError, match=r"cannot list .*writers"):
        expire(recorded, datetime.now(UTC), dry_run=False)
    assert files(recorded) == before


def test_garbage_is_what_no_version_needs(recorded: GraspRepository) -> None:
    needed = files(recorded)
    create_branch(recorded, "dev")
    other = make_header(seed=2, width=64, height=48)
    with SessionWriter.begin(recorded, other, "dev") as writer:
        writer.append(make_attempt(other, 0, outcome=Outcome.HELD))
        writer.seal()
    delete_branch(recorded, "dev", force=True)
    kept = collect_garbage(recorded, dry_run=False)
    assert (kept.bytes, kept.chunks) == (0, 0)
    planned = collect_garbage(recorded, dry_run=True, grace=timedelta(0))
    assert planned.chunks >= 4
    assert files(recorded) > needed
    done = collect_garbage(recorded, dry_run=False, grace=timedelta(0))
    assert (done.bytes, done.chunks, done.snapshots) == (planned.bytes, planned.chunks, planned.snapshots)
    (names,) = recorded.logs([recorded.tip(LEDGER_BRANCH)])
    named = [entry.snapshot_id for entry in names[:2]]  # That it was made, and deleted.
    history = {recorded.folder / kind / name for kind in ("snapshots", "transactions") for name in named}
    assert files(recorded) == needed | history  # Of names, which tells that there was a branch.
    assert verify(opened(recorded)).ok


def test_garbage_waits_for_open_writers(recorded: GraspRepository) -> None:
    """What a writer has put on the disk since its last commit belongs to no version yet."""
    other = make_header(seed=2, width=64, height=48)
    writer = SessionWriter.begin(recorded, other)
    writer.append(make_attempt(other, 0, outcome=Outcome.HELD))
    writer.commit()
    last = recorded.log()[0].written_at
    transaction = recorded.writable("main")
    report = collect_garbage(recorded, dry_run=False, grace=timedelta(0))
    assert report.retained_by == (writer.session,)
    assert report.older_than == last
    assert transaction.snapshot_id == recorded.resolve("main")
    writer.seal()
    assert collect_garbage(recorded, dry_run=True, grace=timedelta(0)).retained_by == ()


def test_expiry_shortens_the_history_and_keeps_what_has_a_name(recorded: GraspRepository) -> None:
    start = recorded.resolve("main")
    recorded.release("v1")
    resumed = SessionWriter.resume(recorded, HEADER)
    for number in range(SIZE, SIZE + 3):
        resumed.append(make_attempt(HEADER, number, outcome=Outcome.HELD))
        resumed.commit()
    resumed.seal()
    tip = recorded.resolve("main")
    before = opened(recorded)
    now = datetime.now(UTC)
    assert expire(recorded, now - timedelta(days=1), dry_run=False).snapshots == ()
    planned = expire(recorded, now, dry_run=True)
    assert len(recorded.log()) > 2
    assert len(planned.snapshots) == len(recorded.log()) - 2
    done = expire(recorded, now, dry_run=False)
    assert done.snapshots == planned.snapshots
    reopened = GraspRepository.open(recorded.path)
    assert {"v1", "main"} <= {*reopened.branches(), *reopened.releases()}
    assert (reopened.resolve("v1"), reopened.resolve("main")) == (start, tip)
    collect_garbage(reopened, dry_run=False, grace=timedelta(0))
    after = opened(reopened)
    assert after.attempts.equals(before.attempts)
    assert verify(after).ok
    assert verify(opened(reopened, "v1")).checked == SIZE
    assert set(done.snapshots).isdisjoint(entry.snapshot_id for entry in reopened.log())
    np.testing.assert_array_equal(after.attempts["number"], range(SIZE + 3))
