"""What a benchmark reports, and how it takes time."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

RUNS = 5
"""Timed repetitions behind each median."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One measurement."""

    name: str
    ours: float
    unit: str
    floor: float | None = None
    """The same measure of the least work that could do the job, in the same unit, where there is such a thing."""
    peers: dict[str, float] = field(default_factory=dict)
    """The same measure of other ways to do the job, on the same data in the same run."""
    n: int
    """How many things were timed in each run: samples, attempts, commits."""
    what: str
    """What was measured, in one sentence."""

    @property
    def ratio(self) -> float | None:
        """``ours / floor``; None without a floor."""
        return None if self.floor is None else self.ours / self.floor

    def as_json(self) -> dict[str, Any]:
        """The figure as JSON values, its ratio included."""
        return {**asdict(self), "ratio": self.ratio}


def median_s(action: Callable[[], object], *, runs: int = RUNS, warm_up: bool = True) -> float:
    """Median duration of an action [s]; ``warm_up`` calls it once more before, untimed."""
    if warm_up:
        action()
    return statistics.median(duration_s(action) for _ in range(runs))


def median_rate(action: Callable[[], object], count: int, *, runs: int = RUNS, warm_up: bool = True) -> float:
    """How many of ``count`` things an action does in a second, by its median duration."""
    return count / median_s(action, runs=runs, warm_up=warm_up)


def duration_s(action: Callable[[], object]) -> float:
    """How long an action takes [s]."""
    start = time.perf_counter()
    action()
    return time.perf_counter() - start
