"""Exclusions and relabels: laid over the attempts, never into them, and always undone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from tests.support.factories import difference, make_attempt, make_header, record
from tests.support.versions import opened

from handsight.datasets import (
    AttemptNotFoundError,
    CurationError,
    Curator,
    GraspDataset,
    GraspRepository,
    Outcome,
    RefNotFoundError,
    Selection,
    UnknownNameError,
    WhereError,
)
from handsight.datasets.format.decisions import Action, Overlay

HEADER = make_header()
SUCCESSES = Selection(where="success")


@pytest.fixture
def curated(repository: GraspRepository) -> GraspRepository:
    """Attempts 0 to 5: held, empty, held, empty, held, aborted."""
    outcomes = [Outcome.HELD, Outcome.EMPTY] * 2 + [Outcome.HELD, Outcome.ABORTED]
    record(repository, HEADER, [make_attempt(HEADER, number, outcome=one) for number, one in enumerate(outcomes)])
    return repository


def numbers(repository: GraspRepository, column: str) -> list[int]:
    table = opened(repository).attempts
    return table["number"][table[column].fillna(False).astype(bool)].tolist()


def by_number(repository: GraspRepository, *which: int) -> Selection:
    return Selection(ids=tuple(opened(repository).attempts.index[list(which)]))


def test_exclusion_is_laid_over_and_taken_back(curated: GraspRepository) -> None:
    before = opened(curated)
    anna = Curator(curated, author="anna")
    decision = anna.exclude(by_number(curated, 0, 5), "cable in view")
    assert decision is not None
    assert (decision.action, decision.author, decision.reason) == (Action.EXCLUDE, "anna", "cable in view")
    excluded = opened(curated)
    assert numbers(curated, "excluded") == [0, 5]
    assert excluded.attempts["exclusion_reason"].dropna().tolist() == ["cable in view"] * 2
    info = excluded.info()
    assert (info.attempts, info.excluded, info.successes) == (6, 2, 2)
    assert excluded.overlay.decisions == (decision,)
    assert curated.log()[0].message == "exclude 2 attempts: cable in view"
    anna.restore(Selection(where="excluded"), "cropped out")
    after = opened(curated)
    assert after.info().excluded == 0
    assert after.attempts.equals(before.attempts)
    assert (after.digest, after.curation_digest) == (before.digest, before.curation_digest)
    assert len(GraspDataset.open(f"{curated.path}@{excluded.snapshot_id}").attempts.query("excluded")) == 2


def test_relabelling_changes_success_and_keeps_what_was_recorded(curated: GraspRepository) -> None:
    anna = Curator(curated, author="anna")
    anna.relabel(by_number(curated, 0, 1), False, "held the table cloth")
    assert numbers(curated, "success") == [2, 4]
    assert numbers(curated, "recorded_success") == [0, 2, 4]
    assert opened(curated).info().successes == 2
    assert opened(curated).info().outcomes["held"] == 3
    stored = opened(curated).attempt(opened(curated).attempts.index[0])
    assert difference(stored, make_attempt(HEADER, 0, outcome=Outcome.HELD)) is None
    anna.relabel(by_number(curated, 1), True, "it moved")
    assert numbers(curated, "success") == [1, 2, 4]
    anna.unlabel(Selection(where="success != recorded_success"), "wrong video")
    assert numbers(curated, "success") == [0, 2, 4]


def test_an_attempt_without_label_cannot_be_relabelled(curated: GraspRepository) -> None:
    tip = curated.resolve("main")
    with pytest.raises(CurationError, match=r"1 of the attempts, .*-000005 the first.*recorded_success.notna"):
        Curator(curated, author="anna").relabel(Selection(where="number > 2"), True, "x")
    assert curated.resolve("main") == tip


def test_what_would_change_nothing_is_no_decision(curated: GraspRepository) -> None:
    anna = Curator(curated, author="anna")
    tip = curated.resolve("main")
    assert anna.exclude(Selection(where="number > 100"), "none") is None
    assert anna.restore(SUCCESSES, "none is excluded") is None
    assert anna.relabel(SUCCESSES, True, "they are") is None
    assert anna.unlabel(SUCCESSES, "none was relabelled") is None
    planned = anna.exclude(SUCCESSES, "try", dry_run=True)
    assert planned is not None
    assert len(planned.attempts) == 3
    assert curated.resolve("main") == tip
    anna.exclude(by_number(curated, 0), "first")
    again = anna.exclude(SUCCESSES, "second")
    assert again is not None
    assert len(again.attempts) == 2
    assert sorted(opened(curated).attempts["exclusion_reason"].dropna()) == ["first", "second", "second"]


def test_undo_takes_back_one_decision_and_undo_of_undo_redoes_it(curated: GraspRepository) -> None:
    anna, ben = Curator(curated, author="anna"), Curator(curated, author="ben")
    anna.exclude(by_number(curated, 0), "dark")
    ben.exclude(by_number(curated, 1), "blurred")
    ben.relabel(by_number(curated, 1), True, "it held")
    assert anna.undo(0).value == 0
    assert numbers(curated, "excluded") == [1]
    assert (ben.undo().value, ben.undo().value) == (2, 1)
    assert numbers(curated, "excluded") == []
    assert numbers(curated, "success") == [0, 2, 4]
    with pytest.raises(UnknownNameError, match="no decision left to undo"):
        anna.undo()
    with pytest.raises(CurationError, match="decision 0 was undone already"):
        anna.undo(0)
    with pytest.raises(UnknownNameError, match="no decision 99, expected 0 to 5"):
        anna.undo(99)
    anna.undo(3, "it was dark after all")
    assert numbers(curated, "excluded") == [0]
    assert opened(curated).overlay.undone == {1, 2, 3}


@pytest.mark.parametrize(
    ("reason", "message"),
    [("", "reason is empty"), (" ", "reason is empty"), ("x" * 513, "at most 512 bytes"), ("a\0", "without NUL")],
)
def test_a_decision_needs_a_reason(curated: GraspRepository, reason: str, message: str) -> None:
    with pytest.raises(CurationError, match=message):
        Curator(curated, author="anna").exclude(SUCCESSES, reason)
    with pytest.raises(CurationError, match=message):
        Curator(curated, author="anna").undo(reason=reason)
    assert opened(curated).overlay.decisions == ()


def test_a_decision_needs_an_author_and_attempts_that_exist(curated: GraspRepository) -> None:
    with pytest.raises(CurationError, match="author is empty"):
        Curator(curated, author="")
    with pytest.raises(CurationError, match="lone surrogate"):
        Curator(curated, author="\ud800")
    anna = Curator(curated, author="anna")
    with pytest.raises(AttemptNotFoundError):
        anna.exclude(Selection(ids=("nowhere-000000",)), "x")
    with pytest.raises(WhereError):
        anna.exclude(Selection(where="sucess"), "x")
    with pytest.raises(RefNotFoundError):
        Curator(curated, author="anna", branch="dev").exclude(SUCCESSES, "x")
    assert opened(curated).overlay.decisions == ()


def test_the_curation_digest_follows_content_not_ids(tmp_path: Path) -> None:
    digests = set()
    for seed, name in enumerate("ab"):
        repository = GraspRepository.create(tmp_path / name)
        header = make_header(seed=seed)
        record(repository, header, [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(3)])
        curator = Curator(repository, author=name)
        curator.exclude(by_number(repository, 1), f"reason {name}")
        digests.add(opened(repository).curation_digest)
    assert len(digests) == 1
    curator.relabel(by_number(repository, 1), False, "x")
    digests.add(opened(repository).curation_digest)
    curator.restore(by_number(repository, 1), "x")
    digests.add(opened(repository).curation_digest)
    curator.unlabel(by_number(repository, 1), "x")
    digests.add(opened(repository).curation_digest)
    assert len(digests) == 4
    assert Overlay().digest(opened(repository).attempts) in digests


def test_decisions_made_at_once_are_all_kept(curated: GraspRepository, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no lock keeps others out, a change that was overtaken is made again from the new tip."""
    ben = Curator(GraspRepository.open(curated.path), author="ben")
    stale = ben.repository.writable("main")
    Curator(curated, author="anna").exclude(SUCCESSES, "first")
    fresh = ben.repository.writable
    changes = iter([stale])
    monkeypatch.setattr(ben.repository, "writable", lambda branch: next(changes, None) or fresh(branch))
    decision = ben.exclude(Selection(where="outcome in ['empty', 'held']"), "second")
    assert decision is not None
    assert len(decision.attempts) == 2
    assert [(one.number, one.author) for one in opened(curated).overlay.decisions] == [(0, "anna"), (1, "ben")]


CURATE = """
import sys
from handsight.datasets import Curator, GraspRepository, Selection
curator = Curator(GraspRepository.open({path!r}), author=sys.argv[1])
sys.stdin.readline()
for number in range(3):
    for act in (curator.exclude, curator.restore):
        assert act(Selection(where=f"number == {{number}} and seed == {{sys.argv[1]}}"), f"try {{number}}") is not None
"""


def test_processes_that_curate_at_once_lose_nothing(repository: GraspRepository) -> None:
    for seed in range(4):
        header = make_header(seed=seed)
        record(repository, header, [make_attempt(header, number) for number in range(6)], every=6)
    program = CURATE.format(path=str(repository.path))
    command = [sys.executable, "-P", "-c", program]
    curators = [
        subprocess.Popen([*command, str(seed)], stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for seed in range(4)
    ]
    for process in curators:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in curators:
        _, complaints = process.communicate(timeout=120)
        assert process.returncode == 0, complaints
    decisions = opened(repository).overlay.decisions
    assert [one.number for one in decisions] == list(range(24))
    for seed in range(4):
        own = [one.reason for one in decisions if one.author == str(seed)]
        assert own == [f"try {number}" for number in range(3) for _ in range(2)]
    assert opened(repository).info().excluded == 0
