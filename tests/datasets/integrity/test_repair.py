"""Damage is taken out on a branch of its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.factories import difference, make_attempt, make_header, record
from tests.support.versions import opened

from handsight.datasets import (
    CorruptDataError,
    GraspAttempt,
    GraspRepository,
    Outcome,
    RefNameError,
    SessionHeader,
    SessionWriter,
    diff_versions,
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
