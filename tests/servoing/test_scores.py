"""Scores are numbers in [0, 1], one for each input, or the network is refused."""

from __future__ import annotations

import numpy as np
import pytest

from handsight.servoing.errors import ScoreError
from handsight.servoing.scores import check_scores


@pytest.mark.parametrize("scores", [[], [0.0, 1.0, 0.5]])
def test_success_metrics_pass(scores: list[float]) -> None:
    check_scores(np.array(scores, np.float32), len(scores))


@pytest.mark.parametrize(
    ("scores", "said"),
    [
        ([np.nan, np.nan], r"2 of 2 scores .* \(2 NaN\)"),
        ([0.5, np.nan, 3, -0.5], r"3 of 4 scores .* \(1 NaN, the others from -0.5 to 3\)"),
        ([0.5, np.inf], r"1 of 2 scores .* \(from inf to inf\)"),
        ([0.5, 1.0000001], "1 of 2 scores"),
    ],
)
def test_it_is_said_how_many_are_none_and_what_they_are(scores: list[float], said: str) -> None:
    with pytest.raises(ScoreError, match=said):
        check_scores(np.array(scores), len(scores))


def test_another_number_of_scores_is_refused() -> None:
    with pytest.raises(ScoreError, match=r"shape \(2,\), expected \(3,\)"):
        check_scores(np.zeros(2), 3)
