"""Ranking label issues: planted errors come first, truth is only reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.drawn import SMALL, drawn_inputs
from tests.support.labelled import labelled_attempts

from handsight.evaluation.label_issues import issue_log_odds, label_quality, rank_label_issues
from handsight.evaluation.label_review import review_folds
from handsight.servoing.errors import ScoreError
from handsight.training.cross_validation import out_of_fold_scores
from handsight.training.metrics import evaluate_scores


def scores_of(*values: float) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
    return np.array(values, np.float32)


@given(
    labels=st.lists(st.booleans(), min_size=1, max_size=30),
    data=st.data(),
)
def test_label_quality_is_the_probability_that_the_network_gives_the_label(
    labels: list[bool], data: st.DataObject
) -> None:
    values = data.draw(st.lists(st.floats(0, 1, width=32), min_size=len(labels), max_size=len(labels)))
    review = rank_label_issues(labelled_attempts(labels), scores_of(*values), count=len(labels))
    assert sorted(one.attempt for one in review.issues) == labelled_attempts(labels).index.tolist()
    qualities = [one.label_quality for one in review.issues]
    assert qualities == sorted(qualities)
    for one in review.issues:
        number = int(one.attempt[1:])
        assert one.success is labels[number]
        assert one.predicted_success == values[number]
        assert one.label_quality == pytest.approx(values[number] if labels[number] else 1 - values[number], abs=1e-6)


def test_facts_of_each_issue_are_those_of_its_attempt() -> None:
    attempts = labelled_attempts([True, False, False, True], truth=[False, False, True, None])
    review = rank_label_issues(attempts, scores_of(0.01, 0.02, 0.9, 0.8), count=4)
    first, second, third, fourth = review.issues
    assert [one.attempt for one in review.issues] == ["a00", "a02", "a03", "a01"]
    assert [one.target for one in review.issues] == ["cup", None, None, None]
    assert [one.truth_held for one in review.issues] == [False, True, None, False]
    assert [one.truth_disagrees for one in review.issues] == [True, True, None, False]
    assert [one.simulator for one in review.issues] == ["disagrees", "disagrees", "-", "agrees"]
    assert [(one.label, one.other_label) for one in (first, second)] == [("success", "failure"), ("failure", "success")]
    assert (third.label, fourth.label) == ("success", "failure")


def test_truth_and_target_have_no_part_in_the_ranking() -> None:
    labels, scores = [True, False, False, True], scores_of(0.4, 0.3, 0.9, 0.5)
    plain = rank_label_issues(labelled_attempts(labels), scores, count=4)
    truth = rank_label_issues(labelled_attempts(labels, truth=[True, True, False, False]), scores, count=4)
    assert [one.attempt for one in plain.issues] == [one.attempt for one in truth.issues]


def test_a_list_may_be_shorter_and_the_metrics_are_still_those_of_all() -> None:
    attempts, scores = labelled_attempts([True, False, False, True]), scores_of(0.1, 0.3, 0.7, 0.8)
    everything = rank_label_issues(attempts, scores, count=4)
    listed = rank_label_issues(attempts, scores, count=2, listed=np.array([False, True, True, True]))
    assert [one.attempt for one in everything.issues] == ["a00", "a02", "a01", "a03"]
    assert [one.attempt for one in listed.issues] == ["a02", "a01"]
    alone = rank_label_issues(attempts, scores, count=2, listed=np.array([False, True, False, False]))
    assert alone.issues == everything.issues[2:3]
    assert listed.metrics == everything.metrics == evaluate_scores(scores, scores_of(1, 0, 0, 1))
    assert "on 4 attempts: balanced accuracy 0.50, AUC 0.50" in listed.trust


@given(labels=st.lists(st.booleans(), min_size=1, max_size=40), count=st.integers(1, 45), seed=st.integers(0, 99))
def test_of_either_label_a_list_holds_those_of_lowest_quality(labels: list[bool], count: int, seed: int) -> None:
    scores = np.random.default_rng(seed).random(len(labels), dtype=np.float32)
    listed = rank_label_issues(labelled_attempts(labels), scores, count=count).issues
    everything = rank_label_issues(labelled_attempts(labels), scores, count=len(labels)).issues
    assert len(listed) == min(count, len(labels))
    assert [one.label_quality for one in listed] == sorted(one.label_quality for one in listed)
    for kind in (True, False):
        own = [one for one in listed if one.success is kind]
        assert own == [one for one in everything if one.success is kind][: len(own)]


def test_of_equal_quality_the_commoner_label_is_listed_first() -> None:
    scores = scores_of(0.3, 0.7, 0.6, *[0.1] * 8)
    mostly_failures = rank_label_issues(labelled_attempts([True] + [False] * 10), scores, count=2)
    assert [one.attempt for one in mostly_failures.issues] == ["a01", "a02"]
    mostly_successes = rank_label_issues(labelled_attempts([False] + [True] * 10), 1 - scores, count=2)
    assert [one.attempt for one in mostly_successes.issues] == ["a01", "a02"]
    # Only half of the prior is taken out: what has a far lower quality is listed, however rare its label.
    certain = rank_label_issues(labelled_attempts([True] + [False] * 10), scores_of(0.05, *scores[1:]), count=2)
    assert [one.attempt for one in certain.issues] == ["a00", "a01"]


@given(pairs=st.lists(st.tuples(st.floats(0.01, 0.99), st.floats(0.01, 0.99)), min_size=1, max_size=20))
def test_where_labels_are_equally_many_the_order_is_that_of_label_quality(pairs: list[tuple[float, float]]) -> None:
    labels = np.array([1.0, 0.0] * len(pairs), np.float32)
    scores = np.array(pairs, np.float32).ravel()
    quality = label_quality(scores, labels)
    np.testing.assert_allclose(issue_log_odds(scores, labels), np.log((1 - quality) / quality), rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("extreme", [0.0, 1.0])
def test_scores_at_the_ends_of_their_range_are_ranked_too(extreme: float) -> None:
    odds = issue_log_odds(scores_of(extreme, extreme), scores_of(1, 1))
    assert np.isfinite(odds).all()


def test_one_label_alone_is_said_to_prove_nothing() -> None:
    assert "one label" in rank_label_issues(labelled_attempts([True, True]), scores_of(0.2, 0.3), count=2).trust


def test_most_of_the_wrong_labels_rank_on_top() -> None:
    data = drawn_inputs(300, seed=0)
    wrong = np.zeros(300, bool)
    wrong[np.random.default_rng(0).choice(300, 15, replace=False)] = True
    attempts = labelled_attempts((data.labels.astype(bool) ^ wrong).tolist())
    scores = out_of_fold_scores(
        replace(data, attempts=attempts), review_folds(attempts, count=3, seed=0), replace(SMALL, epochs=6)
    )
    planted = set(attempts.index[wrong])
    found = [one.attempt in planted for one in rank_label_issues(attempts, scores, count=30).issues]
    assert sum(found) >= 13
    assert sum(found[:15]) >= 11


def test_half_of_what_is_due_to_a_rare_label_is_left_out() -> None:
    """A network that knows nothing says 0.5 of every attempt: what is left is the share of the prior, either way."""
    labels = np.array([1, 0, 0, 0, 0, 0, 0], np.float32)
    odds = issue_log_odds(np.full(len(labels), 0.5, np.float32), labels)
    half = 0.5 * np.log((1 + 1) / (6 + 1))
    np.testing.assert_allclose(odds, np.where(labels > 0.5, half, -half))


def test_labels_are_not_held_against_scores_that_are_none() -> None:
    with pytest.raises(ScoreError, match="1 of 2 scores"):
        rank_label_issues(labelled_attempts([True, False]), scores_of(0.5, np.nan), count=2)
