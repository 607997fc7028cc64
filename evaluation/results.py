"""Tables of results: success with n and Wilson's 95 % interval."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from scipy import stats

if TYPE_CHECKING:
    # A table takes no torch, which running a trial does.
    from handsight.evaluation.trial import Trial


class ResultRow(TypedDict):
    """One row of ``evaluate --json``."""

    method: str
    objects: str
    trials: int
    successes: int
    rate: float
    ci95: tuple[float, float]
    """Wilson's interval for the rate."""
    step_ms: float | None
    """Median time per servo step from picture to decision [ms]; None without servoing."""
    mean_steps: float | None
    """Mean number of servo moves; None without servoing."""


def wilson_95(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a proportion; (0, 1) when there were no trials."""
    if trials == 0:
        return 0.0, 1.0
    interval = stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def result_rows(trials: Iterable[Trial], *, objects: str, methods: Sequence[str]) -> list[ResultRow]:
    """One row for each method, in the order given."""
    everything = list(trials)
    return [_row([trial for trial in everything if trial.method == name], name, objects) for name in methods]


def _row(trials: list[Trial], method: str, objects: str) -> ResultRow:
    successes = sum(trial.success for trial in trials)
    times_s = [trial.compute_s for trial in trials if np.isfinite(trial.compute_s)]
    return ResultRow(
        method=method,
        objects=objects,
        trials=len(trials),
        successes=successes,
        rate=successes / len(trials) if trials else 0.0,
        ci95=wilson_95(successes, len(trials)),
        step_ms=1e3 * float(np.median(times_s)) if times_s else None,
        mean_steps=float(np.mean([trial.moves for trial in trials])) if times_s else None,
    )
