"""A walk over attempts: each verdict is one decision, and undo goes back to its attempt."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.lab import make_lab

from handsight.datasets import CurationError, Curator
from handsight.datasets.curation.review import Review, Verdict

REASON = "looked at it"


@pytest.fixture
def review(tmp_path: Path) -> Review:
    """Of four attempts: held, empty and excluded, aborted, empty."""
    repository = make_lab(tmp_path / "lab")
    from handsight.datasets import GraspDataset

    ids = [str(key) for key in GraspDataset.open(str(repository.path)).attempts.index[:4]]
    return Review(Curator(repository, author="me"), ids, reason=REASON)


def test_verdicts_decide_and_go_on(review: Review) -> None:
    first, second, third, fourth = (review._ids[at] for at in range(4))
    assert review.say("exclude").attempt == first
    assert review.say("restore").attempt == second
    assert review.say("keep").decision is None
    assert review.say("success").decision is None, "it was relabelled so before"
    assert review.attempt is None
    rows = review.dataset().attempts
    assert rows["excluded"][[first, second, third, fourth]].tolist() == [True, False, False, False]
    assert rows["exclusion_reason"][first] == REASON
    assert rows["success"][fourth]
    assert review.looked_at == 4


def test_undo_goes_back_and_leaves_the_version_as_it_was(review: Review) -> None:
    before = review.dataset().attempts
    for verdict in ("exclude", "restore", "next"):
        review.say(verdict)
    assert review.position == 3
    assert review.say("undo").decision is not None
    assert review.position == 1
    review.say("undo")
    assert (review.position, review.decisions) == (0, ())
    assert review.say("undo").decision is None
    after = review.dataset().attempts
    assert after["excluded"].equals(before["excluded"])
    assert after["success"].equals(before["success"])


def test_what_has_no_label_is_not_relabelled_and_nobody_goes_on(review: Review) -> None:
    for _ in range(2):
        review.say("next")
    with pytest.raises(CurationError, match="have no label to correct"):
        review.say("failure")
    assert (review.position, review.decisions, review.looked_at) == (2, (), 0)


def test_back_stops_at_the_first(review: Review) -> None:
    review.say("next")
    for _ in range(3):
        review.say("back")
    assert review.position == 0


class Spoken:
    """A curator that only counts, for walks of any kind."""

    def __init__(self) -> None:
        self.alive: list[int] = []
        self.count = 0

    def decide(self, *arguments: object) -> object:
        self.count += 1
        self.alive.append(self.count)
        return type("Decision", (), {"number": self.count})()

    exclude = restore = relabel = unlabel = decide

    def undo(self, number: int, reason: str) -> object:
        self.alive.remove(number)
        return type("Decision", (), {"number": number})()


@given(st.lists(st.sampled_from(["keep", "exclude", "success", "undo", "back", "next"]), max_size=40))
def test_what_counts_is_what_was_decided_and_not_undone(verdicts: list[Verdict]) -> None:
    curator = Spoken()
    review = Review(curator, [str(number) for number in range(5)], reason=REASON)  # type: ignore[arg-type]
    for verdict in verdicts:
        if review.attempt is None and verdict not in ("undo", "back"):
            with pytest.raises(IndexError):
                review.say(verdict)
            continue
        review.say(verdict)
        assert [one.number for one in review.decisions] == curator.alive
        assert 0 <= review.position <= 5
