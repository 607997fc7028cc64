"""Folds of a review of labels: scenes stay together, the seed decides, what cannot be divided is refused."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.labelled import labelled_attempts

from handsight.evaluation.errors import EvaluationSettingsError, LabelIssuesError
from handsight.evaluation.label_review import review_folds


@given(
    scenes=st.lists(st.sampled_from(["a b", "b a", "c", "d", "e f", "g", ""]), min_size=12, max_size=60),
    seed=st.integers(0, 100),
)
def test_scenes_are_never_split(scenes: list[str], seed: int) -> None:
    labels = [number % 2 == 0 for number in range(len(scenes))]
    folds = review_folds(labelled_attempts(labels, scenes=scenes), count=3, seed=seed)
    keys = [" ".join(sorted(scene.split())) or f"alone {number}" for number, scene in enumerate(scenes)]
    assert set(folds.tolist()) == {0, 1, 2}
    if len(set(keys)) >= 3:
        by_scene = pd.Series(folds).groupby(keys).nunique()
        assert by_scene.max() == 1


@pytest.mark.parametrize("scene", ["", "always the same"], ids=["unknown", "one"])
def test_attempts_that_no_scene_tells_apart_are_divided_evenly(scene: str) -> None:
    attempts = labelled_attempts([number % 4 == 0 for number in range(48)], scenes=[scene] * 48)
    folds = review_folds(attempts, count=3, seed=0)
    assert np.bincount(folds).tolist() == [16, 16, 16]
    assert np.bincount(folds[attempts["success"].to_numpy(dtype=bool)]).tolist() == [4, 4, 4]


def test_attempts_of_unknown_scenes_are_no_scene_of_their_own() -> None:
    folds = review_folds(
        labelled_attempts([number % 2 == 0 for number in range(36)], scenes=["a", "b", "c"] + [""] * 33),
        count=3,
        seed=0,
    )
    assert np.bincount(folds).tolist() == [12, 12, 12]


def test_the_same_seed_divides_alike_and_another_does_not() -> None:
    attempts = labelled_attempts([number % 4 == 0 for number in range(48)])
    first = review_folds(attempts, count=3, seed=0)
    np.testing.assert_array_equal(review_folds(attempts, count=3, seed=0), first)
    assert (review_folds(attempts, count=3, seed=1) != first).any()


def test_what_cannot_be_divided_is_refused() -> None:
    with pytest.raises(LabelIssuesError, match="2 successes and 6 failures, expected at least 3 of each"):
        review_folds(labelled_attempts([True] * 2 + [False] * 6), count=3, seed=0)
    with pytest.raises(LabelIssuesError, match="8 successes and 0 failures"):
        review_folds(labelled_attempts([True] * 8), count=3, seed=0)
    with pytest.raises(EvaluationSettingsError, match="folds are 1, expected at least 2; seed is -1"):
        review_folds(labelled_attempts([True, False]), count=1, seed=-1)
