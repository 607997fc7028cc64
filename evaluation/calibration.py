"""Whether grasps hold as often as the network says: its score at the grasp against what came of it.

A network whose scores of 0.9 hold nine times in ten is calibrated, and its threshold means what it says. Scores are
those of the picture taken at the pose that was grasped, so that they say nothing of the search that led there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final, TypedDict

import numpy as np

from handsight.evaluation.results import wilson_95

if TYPE_CHECKING:
    from handsight.evaluation.trial import Trial

SCORE_EDGES: Final = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.97, 0.99, 1.0)
"""Bins of scores, narrower where most grasps are executed: above the threshold."""


class CalibrationRow(TypedDict):
    """The trials of a method whose score at the grasp is in one bin."""

    method: str
    objects: str
    low: float
    """Least score of the bin."""
    high: float
    """Scores are below this; the last bin has its end too."""
    trials: int
    mean_score: float
    successes: int
    rate: float
    ci95: tuple[float, float]
    """Wilson's interval for the rate; where it leaves the mean score out, the network is over- or underconfident."""


def calibration_rows(trials: Iterable[Trial], *, objects: str, methods: Sequence[str]) -> list[CalibrationRow]:
    """A row for each bin that holds trials, in the order of methods and scores; none for methods that do not servo."""
    scored: dict[str, list[tuple[float, bool]]] = {name: [] for name in methods}
    for trial in trials:
        if trial.score is not None and not trial.aborted and trial.method in scored:
            scored[trial.method].append((trial.score, trial.success))
    return [row for name in methods for row in _rows(scored[name], name, objects)]


def _rows(scored: list[tuple[float, bool]], method: str, objects: str) -> Iterable[CalibrationRow]:
    last = SCORE_EDGES[-1]
    for low, high in pairwise(SCORE_EDGES):
        inside = [one for one in scored if low <= one[0] < high or (high == last and one[0] == last)]
        if inside:
            successes = sum(held for _, held in inside)
            yield CalibrationRow(
                method=method,
                objects=objects,
                low=low,
                high=high,
                trials=len(inside),
                mean_score=float(np.mean([score for score, _ in inside])),
                successes=successes,
                rate=successes / len(inside),
                ci95=wilson_95(successes, len(inside)),
            )
