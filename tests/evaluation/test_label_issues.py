"""Ranking doubted labels: planted errors come first, truth is only reported, folds keep scenes together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.drawn import SMALL, drawn_inputs

from handsight.evaluation.errors import EvaluationSettingsError, LabelIssuesError
from handsight.evaluation.label_issues import issue_log_odds, label_doubt, rank_label_issues, review_folds
from handsight.training.cross_validation import out_of_fold_scores
from handsight.training.metrics import evaluate_scores


def table(
    labels: list[bool], *, truth: list[bool | None] | None = None, scenes: list[str] | None = None
) -> pd.DataFrame:
    """Labelled attempts a00, a01, ..., each in a scene of its own unless scenes are given."""
    ids = [f"a{number:02}" for number in range(len(labels))]
    return pd.DataFrame(
        {
            "success": pd.array(labels, dtype="boolean"),
            "truth_held": pd.array([None] * len(labels) if truth is None else truth, dtype="boolean"),
            "target": pd.array(["cup"] + [None] * (len(labels) - 1), dtype="str"),
            "objects": [tuple(scene.split()) for scene in (ids if scenes is None else scenes)],
        },
        index=pd.Index(ids, name="attempt", dtype="str"),
    )


def scores_of(*values: float) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
    return np.array(values, np.float32)


@given(
    labels=st.lists(st.booleans(), min_size=1, max_size=30),
    data=st.data(),
)
def test_doubt_is_what_the_network_leaves_of_the_label(labels: list[bool], data: st.DataObject) -> None:
    values = data.draw(st.lists(st.floats(0, 1, width=32), min_size=len(labels), max_size=len(labels)))
    review = rank_label_issues(table(labels), scores_of(*values), count=len(labels))
    assert sorted(one.attempt for one in review.suspects) == table(labels).index.tolist()
    doubts = [one.doubt for one in review.suspects]
    assert doubts == sorted(doubts, reverse=True)
    for one in review.suspects:
        number = int(one.attempt[1:])
        assert one.success is labels[number]
        assert one.predicted_success == values[number]
        assert one.doubt == pytest.approx(1 - values[number] if labels[number] else values[number], abs=1e-6)


def test_facts_of_each_suspect_are_those_of_its_attempt() -> None:
    attempts = table([True, False, False, True], truth=[False, False, True, None])
    review = rank_label_issues(attempts, scores_of(0.01, 0.02, 0.9, 0.8), count=4)
    first, second, third, fourth = review.suspects
    assert [one.attempt for one in review.suspects] == ["a00", "a02", "a03", "a01"]
    assert [one.target for one in review.suspects] == ["cup", None, None, None]
    assert [one.truth_held for one in review.suspects] == [False, True, None, False]
    assert [one.truth_disagrees for one in review.suspects] == [True, True, None, False]
    assert [one.simulator for one in review.suspects] == ["disagrees", "disagrees", "-", "agrees"]
    assert [(one.label, one.other_label) for one in (first, second)] == [("success", "failure"), ("failure", "success")]
    assert (third.label, fourth.label) == ("success", "failure")


def test_truth_and_target_have_no_part_in_the_ranking() -> None:
    labels, scores = [True, False, False, True], scores_of(0.4, 0.3, 0.9, 0.5)
    plain = rank_label_issues(table(labels), scores, count=4)
    truth = rank_label_issues(table(labels, truth=[True, True, False, False]), scores, count=4)
    assert [one.attempt for one in plain.suspects] == [one.attempt for one in truth.suspects]


def test_a_list_may_be_shorter_and_the_quality_is_still_that_of_all() -> None:
    attempts, scores = table([True, False, False, True]), scores_of(0.1, 0.3, 0.7, 0.8)
    everything = rank_label_issues(attempts, scores, count=4)
    listed = rank_label_issues(attempts, scores, count=2, listed=np.array([False, True, True, True]))
    assert [one.attempt for one in everything.suspects] == ["a00", "a02", "a01", "a03"]
    assert [one.attempt for one in listed.suspects] == ["a02", "a01"]
    alone = rank_label_issues(attempts, scores, count=2, listed=np.array([False, True, False, False]))
    assert alone.suspects == everything.suspects[2:3]
    assert listed.quality == everything.quality == evaluate_scores(scores, scores_of(1, 0, 0, 1))
    assert "on 4 attempts: balanced accuracy 0.50, AUC 0.50" in listed.trust


@given(labels=st.lists(st.booleans(), min_size=1, max_size=40), count=st.integers(1, 45), seed=st.integers(0, 99))
def test_of_either_label_a_list_holds_the_most_doubted(labels: list[bool], count: int, seed: int) -> None:
    scores = np.random.default_rng(seed).random(len(labels), dtype=np.float32)
    listed = rank_label_issues(table(labels), scores, count=count).suspects
    everything = rank_label_issues(table(labels), scores, count=len(labels)).suspects
    assert len(listed) == min(count, len(labels))
    assert [one.doubt for one in listed] == sorted((one.doubt for one in listed), reverse=True)
    for kind in (True, False):
        own = [one for one in listed if one.success is kind]
        assert own == [one for one in everything if one.success is kind][: len(own)]


def test_equally_doubted_the_commoner_label_is_listed_first() -> None:
    scores = scores_of(0.3, 0.7, 0.6, *[0.1] * 8)
    mostly_failures = rank_label_issues(table([True] + [False] * 10), scores, count=2)
    assert [one.attempt for one in mostly_failures.suspects] == ["a01", "a02"]
    mostly_successes = rank_label_issues(table([False] + [True] * 10), 1 - scores, count=2)
    assert [one.attempt for one in mostly_successes.suspects] == ["a01", "a02"]
    # Only half of the prior is taken out: what is far more doubted is listed, however rare its label.
    certain = rank_label_issues(table([True] + [False] * 10), scores_of(0.05, *scores[1:]), count=2)
    assert [one.attempt for one in certain.suspects] == ["a00", "a01"]


@given(pairs=st.lists(st.tuples(st.floats(0.01, 0.99), st.floats(0.01, 0.99)), min_size=1, max_size=20))
def test_where_labels_are_equally_many_the_order_is_that_of_the_doubt(pairs: list[tuple[float, float]]) -> None:
    labels = np.array([1.0, 0.0] * len(pairs), np.float32)
    scores = np.array(pairs, np.float32).ravel()
    doubt = label_doubt(scores, labels)
    np.testing.assert_allclose(issue_log_odds(scores, labels), np.log(doubt / (1 - doubt)), rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("extreme", [0.0, 1.0])
def test_scores_at_the_ends_of_their_range_are_ranked_too(extreme: float) -> None:
    odds = issue_log_odds(scores_of(extreme, extreme), scores_of(1, 1))
    assert np.isfinite(odds).all()


def test_one_label_alone_is_said_to_prove_nothing() -> None:
    assert "one label" in rank_label_issues(table([True, True]), scores_of(0.2, 0.3), count=2).trust


def test_most_of_the_wrong_labels_rank_on_top() -> None:
    data = drawn_inputs(300, seed=0)
    wrong = np.zeros(300, bool)
    wrong[np.random.default_rng(0).choice(300, 15, replace=False)] = True
    attempts = table((data.labels.astype(bool) ^ wrong).tolist())
    scores = out_of_fold_scores(
        replace(data, attempts=attempts), review_folds(attempts, count=3, seed=0), replace(SMALL, epochs=6)
    )
    planted = set(attempts.index[wrong])
    found = [one.attempt in planted for one in rank_label_issues(attempts, scores, count=30).suspects]
    assert sum(found) >= 13
    assert sum(found[:15]) >= 11


@given(
    scenes=st.lists(st.sampled_from(["a b", "b a", "c", "d", "e f", "g", ""]), min_size=12, max_size=60),
    seed=st.integers(0, 100),
)
def test_scenes_are_never_split(scenes: list[str], seed: int) -> None:
    labels = [number % 2 == 0 for number in range(len(scenes))]
    folds = review_folds(table(labels, scenes=scenes), count=3, seed=seed)
    keys = [" ".join(sorted(scene.split())) or f"alone {number}" for number, scene in enumerate(scenes)]
    assert set(folds.tolist()) == {0, 1, 2}
    if len(set(keys)) >= 3:
        by_scene = pd.Series(folds).groupby(keys).nunique()
        assert by_scene.max() == 1


@pytest.mark.parametrize("scene", ["", "always the same"], ids=["unknown", "one"])
def test_attempts_that_no_scene_tells_apart_are_divided_evenly(scene: str) -> None:
    attempts = table([number % 4 == 0 for number in range(48)], scenes=[scene] * 48)
    folds = review_folds(attempts, count=3, seed=0)
    assert np.bincount(folds).tolist() == [16, 16, 16]
    assert np.bincount(folds[attempts["success"].to_numpy(dtype=bool)]).tolist() == [4, 4, 4]


def test_attempts_of_unknown_scenes_are_no_scene_of_their_own() -> None:
    folds = review_folds(
        table([number % 2 == 0 for number in range(36)], scenes=["a", "b", "c"] + [""] * 33), count=3, seed=0
    )
    assert np.bincount(folds).tolist() == [12, 12, 12]


def test_the_same_seed_divides_alike_and_another_does_not() -> None:
    attempts = table([number % 4 == 0 for number in range(48)])
    first = review_folds(attempts, count=3, seed=0)
    np.testing.assert_array_equal(review_folds(attempts, count=3, seed=0), first)
    assert (review_folds(attempts, count=3, seed=1) != first).any()


def test_what_cannot_be_divided_is_refused() -> None:
    with pytest.raises(LabelIssuesError, match="2 successes and 6 failures, expected at least 3 of each"):
        review_folds(table([True] * 2 + [False] * 6), count=3, seed=0)
    with pytest.raises(LabelIssuesError, match="8 successes and 0 failures"):
        review_folds(table([True] * 8), count=3, seed=0)
    with pytest.raises(EvaluationSettingsError, match="folds are 1, expected at least 2; seed is -1"):
        review_folds(table([True, False]), count=1, seed=-1)
