"""Tables of results: success with n and Wilson's 95 % interval."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from scipy import stats

from handsight.datasets.errors import counted

if TYPE_CHECKING:
    # A table takes no torch, which running a trial does.
    from handsight.evaluation.trial import Trial


class ResultRow(TypedDict):
    """One row of ``evaluate --json``."""

    method: str
    objects: str
    trials: int
    """Trials that count: those that were not aborted."""
    aborted: int
    """Trials in which nothing was grasped, for no fault of the method; in no other number of the row."""
    successes: int
    rate: float
    """Successes of the trials that count; 0 where none does, with an interval from 0 to 1."""
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


def why_nothing_counts(trials: Iterable[Trial]) -> str | None:
    """What kept every trial from being counted, with the most frequent reason; None where one counts."""
    everything = list(trials)
    if not everything or not all(trial.aborted for trial in everything):
        return None
    (reason, often), *others = Counter(trial.failure for trial in everything).most_common()
    more = f", {often} times" if others else ""
    return (
        f"every trial was aborted ({counted(len(everything), 'trial')}), expected at least one that counts: "
        f"{reason}{more}; mend the station or the network, and evaluate again"
    )


def _row(everything: list[Trial], method: str, objects: str) -> ResultRow:
    trials = [trial for trial in everything if not trial.aborted]
    successes = sum(trial.success for trial in trials)
    times_s = [trial.compute_s for trial in trials if np.isfinite(trial.compute_s)]
    return ResultRow(
        method=method,
        objects=objects,
        trials=len(trials),
        aborted=len(everything) - len(trials),
        successes=successes,
        rate=successes / len(trials) if trials else 0.0,
        ci95=wilson_95(successes, len(trials)),
        step_ms=1e3 * float(np.median(times_s)) if times_s else None,
        mean_steps=float(np.mean([trial.moves for trial in trials])) if times_s else None,
    )
