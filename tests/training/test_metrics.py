from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handsight.servoing.errors import ScoreError
from handsight.training.metrics import evaluate_scores

scored = st.lists(st.tuples(st.sampled_from([0.0, 0.2, 0.5, 0.51, 0.9, 1.0]), st.booleans()), min_size=2, max_size=40)


@given(pairs=scored)
def test_auc_counts_the_pairs_in_which_a_success_scores_higher(pairs: list[tuple[float, bool]]) -> None:
    scores = np.array([score for score, _ in pairs], np.float32)
    labels = np.array([label for _, label in pairs], np.float32)
    metrics = evaluate_scores(scores, labels)
    good, bad = scores[labels == 1], scores[labels == 0]
    if not len(good) or not len(bad):
        assert metrics.auc is None
        assert metrics.accuracy is None
        return
    wins = sum((g > b) + 0.5 * (g == b) for g in good for b in bad)
    assert metrics.auc == pytest.approx(wins / (len(good) * len(bad)))
    assert metrics.accuracy == pytest.approx(0.5 * ((good > 0.5).mean() + (bad <= 0.5).mean()))


def test_loss_is_the_mean_cross_entropy() -> None:
    metrics = evaluate_scores(np.array([0.8, 0.4], np.float32), np.array([1, 0], np.float32))
    assert metrics.loss == pytest.approx(-(math.log(0.8) + math.log(0.6)) / 2, rel=1e-6)


@pytest.mark.parametrize("bad", [np.nan, -0.1, 1.5])
def test_scores_that_are_none_have_no_metrics(bad: float) -> None:
    with pytest.raises(ScoreError, match="1 of 2 scores"):
        evaluate_scores(np.array([0.5, bad], np.float32), np.array([0, 1], np.float32))
