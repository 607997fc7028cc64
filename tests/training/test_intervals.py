from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from handsight.training.intervals import mean_over_trials


def test_the_interval_is_that_of_the_corrected_t_test() -> None:
    """Nadeau and Bengio's factor, by hand: (1/J + t/(1-t)) of the variance."""
    found = mean_over_trials([0.8, 0.9, 0.7, 0.8], held_out=0.2)
    half = stats.t.ppf(0.975, 3) * math.sqrt((1 / 4 + 0.25) * (0.02 / 3))
    assert found.mean == pytest.approx(0.8)
    assert (found.low, found.high) == pytest.approx((0.8 - half, 0.8 + half))
    assert found.trials == 4


def test_its_p_is_five_per_cent_where_the_interval_ends_at_zero() -> None:
    values = np.array([0.02, 0.05, 0.01, 0.03, 0.06])
    found = mean_over_trials(values.tolist(), held_out=0.25)
    assert found.low is not None
    moved = mean_over_trials((values - found.low).tolist(), held_out=0.25)
    assert moved.p == pytest.approx(0.05)


def test_of_one_trial_nothing_but_its_value_is_known() -> None:
    found = mean_over_trials([0.7], held_out=0.2)
    assert (found.mean, found.low, found.high, found.p) == (0.7, None, None, None)


@pytest.mark.parametrize(("values", "p"), [([0.0, 0.0], 1.0), ([0.1, 0.1], 0.0)])
def test_without_spread_a_mean_is_zero_or_not(values: list[float], p: float) -> None:
    assert mean_over_trials(values, held_out=0.2).p == p


def test_overlap_makes_intervals_wider_and_they_cover() -> None:
    """Means over trials that share a part of their error: the plain interval is far too narrow, this one is not."""
    rng, truth, share = np.random.default_rng(0), 0.8, 0.2
    covered = plain = 0
    for _ in range(400):
        common = rng.normal(0, math.sqrt(share) * 0.05)
        values = truth + common + rng.normal(0, math.sqrt(1 - share) * 0.05, 10)
        found = mean_over_trials(values.tolist(), held_out=share)
        assert found.low is not None
        assert found.high is not None
        covered += found.low <= truth <= found.high
        half = stats.t.ppf(0.975, 9) * values.std(ddof=1) / math.sqrt(10)
        plain += abs(values.mean() - truth) <= half
    assert covered / 400 >= 0.94
    assert plain / 400 < 0.85
