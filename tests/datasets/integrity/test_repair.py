"""Damage is taken out on a branch of its own, and old files go without anything that is needed."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from tests.support.factories import difference, make_attempt, make_header, record

from handsight.datasets import (
    CorruptDataError,
    GraspAttempt,
    GraspDataset,
    GraspRepository,
    Outcome,
    RefNameError,
    SessionHeader,
    SessionWriter,
    collect_garbage,
    create_branch,
    delete_branch,
    diff_versions,
    expire,
    repair,
    verify,
)
from handsight.datasets.format.validation import attempt_faults

HEADER = make_header(width=64, height=48)
SIZE = 5


@pytest.fixture
def recorded(repository: GraspRepository) -> GraspRepository:
    attempts = [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(SIZE)]
    record(repository, HEADER, attempts, every=SIZE)
    return repository


def opened(repository: GraspRepository, ref: str = "main") -> GraspDataset:
    return GraspDataset.open(f"{repository.path}@{ref}")


def simulate(header: SessionHeader, number: int) -> GraspAttempt:
    return make_attempt(header, number, outcome=Outcome.HELD)


def chunks(repository: GraspRepository) -> list[Path]:
    return sorted((repository.folder / "chunks").iterdir(), key=lambda path: path.stat().st_size)


def spoil(path: Path) -> None:
    path.write_bytes(bytes(path.stat().st_size))


def test_what_cannot_be_simulated_is_set_aside(recorded: GraspRepository) -> None:
    spoil(chunks(recorded)[-1])
    damaged = opened(recorded)
    report = verify(damaged)
    assert len(report.corrupt) == 1
    done = repair(damaged, report, branch="repaired", author="anna")
    assert (done.simulated, done.lost) == ((), report.corrupt)
    repaired = opened(recorded, "repaired")
    assert done.snapshot == repaired.snapshot_id
    assert verify(repaired).ok
    assert repaired.info().excluded == 1
    assert repaired.info().successes == SIZE - 1
    (reason,) = repaired.attempts["exclusion_reason"].dropna()
    assert reason.startswith("damaged in storage: ")
    for identity in repaired.attempts.index:
        attempt = repaired.attempt(identity)
        assert attempt_faults(attempt, HEADER) == []
        if identity not in done.lost:
            assert difference(attempt, simulate(HEADER, attempt.number)) is None
    diff = diff_versions(damaged, repaired)
    assert diff.replaced == diff.excluded == done.lost
    assert verify(opened(recorded)).corrupt == report.corrupt


def test_what_can_be_simulated_comes_back(recorded: GraspRepository) -> None:
    digest = opened(recorded).digest
    for path in chunks(recorded)[-3:]:
        spoil(path)
    damaged = opened(recorded)
    report = verify(damaged)
    done = repair(damaged, report, branch="repaired", author="anna", resimulate=simulate)
    assert (done.simulated, done.lost) == (report.corrupt, ())
    repaired = opened(recorded, "repaired")
    assert verify(repaired).ok
    assert (repaired.digest, repaired.info().excluded) == (digest, 0)


def test_a_simulation_that_ends_otherwise_proves_nothing(recorded: GraspRepository) -> None:
    spoil(chunks(recorded)[-1])
    damaged = opened(recorded)

    def other(header: SessionHeader, number: int) -> GraspAttempt:
        return make_attempt(header, number, outcome=Outcome.EMPTY)

    done = repair(damaged, verify(damaged), branch="repaired", author="anna", resimulate=other)
    assert (len(done.simulated), len(done.lost)) == (0, 1)


def test_a_damaged_column_takes_all_its_rows(repository: GraspRepository) -> None:
    """Without repair not even the table of such a version can be read."""
    header = make_header()
    with SessionWriter.begin(repository, header) as writer:
        for number in range(300):
            writer.append(make_attempt(header, number, outcome=Outcome.HELD))
    poses = max(chunks(repository), key=lambda path: path.stat().st_size)
    spoil(poses)
    damaged = opened(repository)
    report = verify(damaged)
    assert len(report.corrupt) == 256
    done = repair(damaged, report, branch="blank", author="anna")
    assert len(done.lost) == 256
    blank = opened(repository, "blank")
    assert verify(blank).ok
    assert blank.attempts["excluded"].tolist() == [True] * 256 + [False] * 44

    def again(header: SessionHeader, number: int) -> GraspAttempt:
        return make_attempt(header, number, outcome=Outcome.HELD)

    assert len(repair(damaged, report, branch="whole", author="anna", resimulate=again).simulated) == 256
    whole = opened(repository, "whole")
    assert verify(whole).ok
    assert len(whole.attempts) == 300


def test_a_failed_repair_leaves_no_branch(recorded: GraspRepository) -> None:
    spoil(chunks(recorded)[-1])
    damaged = opened(recorded)
    report = verify(damaged)

    def broken(header: SessionHeader, number: int) -> GraspAttempt:
        raise CorruptDataError("no such mesh")

    with pytest.raises(CorruptDataError, match="no such mesh"):
        repair(damaged, report, branch="repaired", author="anna", resimulate=broken)
    with pytest.raises(RefNameError):
        repair(damaged, report, branch="main", author="anna")
    assert recorded.branches().keys() == {"main"}


def files(repository: GraspRepository) -> set[Path]:
    return {path for path in repository.folder.rglob("*") if path.is_file() and ".handsight" not in path.parts}


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
    assert files(recorded) == needed
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
