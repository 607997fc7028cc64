"""Intervals of means over trials of cross-validation, whose training sets overlap.

Trials that share most of what they learn from are not independent, and the plain standard error is too small: the
interval would cover the truth far less often than it says. The variance of the mean is therefore taken to be
(1/J + t / (1 - t)) times that of the trials, for J trials that each hold out the share t (Nadeau and Bengio 2003,
Inference for the generalization error, section 4: the corrected resampled t-test).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanOverTrials:
    """A mean with its 95 % interval."""

    mean: float
    low: float | None
    """None of a single trial, of which nothing is known but its value."""
    high: float | None
    trials: int
    p: float | None
    """Of the mean being 0, two-sided; None of a single trial. For differences."""

    def as_share(self) -> MeanOverTrials:
        """The same of a share: no further than from 0 to 1, where a share must lie."""
        if self.low is None or self.high is None:
            return self
        return replace(self, low=max(self.low, 0.0), high=min(self.high, 1.0))


def mean_over_trials(values: Sequence[float], *, held_out: float) -> MeanOverTrials:
    """The mean of what the trials of a cross-validation gave.

    Args:
        values: One for each trial; at least one.
        held_out: Share of the attempts that a trial holds out, in (0, 1).
    """
    trials, mean = len(values), float(np.mean(values))
    if trials < 2:
        return MeanOverTrials(mean=mean, low=None, high=None, trials=trials, p=None)
    error = float(np.std(values, ddof=1)) * math.sqrt(1 / trials + held_out / (1 - held_out))
    half = float(stats.t.ppf(0.975, trials - 1)) * error
    # Without any spread it is 0 or it is not.
    p = float(2 * stats.t.sf(abs(mean) / error, trials - 1)) if error > 0 else float(mean == 0)
    return MeanOverTrials(mean=mean, low=mean - half, high=mean + half, trials=trials, p=p)
