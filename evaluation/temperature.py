"""Scores that mean what they say: logits divided by one number, fitted on attempts that the network never learnt from.

Networks trained to the end are too sure of themselves, and most of a heatmap is then 0.00 or 1.00. Temperature scaling
(Guo et al. 2017, On calibration of modern neural networks) softens all scores alike: which of two is higher, and which
grasp is best, stay as they were. ``calibration.py`` asks afterwards whether grasps hold as often as is said.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from handsight.datasets.errors import counted
from handsight.servoing.scores import check_scores

LEAST: Final = 10
"""Attempts below which no temperature is fitted: it would be chance."""
_COLDEST, _HOTTEST = 0.25, 20.0
_ALMOST = 1e-6
"""How near to 0 and 1 a float32 score still tells its logit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Temperature:
    """What scores are divided by, on the scale of logits."""

    value: float = 1.0
    """1 leaves scores as they are; above it they are softened."""
    attempts: int = 0
    """Attempts it was fitted on; 0 where it was not fitted."""
    source: str = "not fitted"
    """Of which attempts, or why of none: a phrase for people."""

    @property
    def fitted(self) -> bool:
        """Whether scores are calibrated, and not as the network gave them."""
        return self.attempts > 0

    def __call__(self, scores: ArrayLike) -> NDArray[np.float32]:
        """Scores of the network in [0, 1], calibrated. (...) -> (...)."""
        given = np.asarray(scores, dtype=np.float32)
        if not self.fitted:
            return given
        return _sigmoid(_logits(given) / self.value).astype(np.float32)

    def __str__(self) -> str:
        if not self.fitted:
            return f"S as the network gives it, not calibrated: {self.source}"
        return (
            f"calibrated S (temperature {self.value:.2f}, fitted on {counted(self.attempts, 'attempt')} {self.source})"
        )


def fit_temperature(scores: NDArray[np.float32], labels: NDArray[np.float32], *, source: str) -> Temperature:
    """The temperature at which outcomes are likeliest.

    Args:
        scores: Of the network, on attempts that it never learnt from. Shape (N,).
        labels: 1 where the grasp held. Shape (N,).
        source: Which attempts, for people.

    Returns:
        One that is not fitted where there are fewer than ``LEAST`` attempts, or all ended alike.

    Raises:
        ScoreError: There is not one score for each label, or some are not in [0, 1].
    """
    check_scores(scores, len(labels))
    held = int((labels > 0.5).sum())
    if len(labels) < LEAST or held in (0, len(labels)):
        few = f"{counted(len(labels), 'attempt')} {source}, {held} held: too few to fit a temperature on"
        return Temperature(source=few)
    logits = _logits(scores)
    # Platt's targets: with few attempts no outcome is taken for certain.
    sure, unsure = (held + 1) / (held + 2), 1 / (len(labels) - held + 2)
    targets = np.where(labels > 0.5, sure, unsure)

    def loss(log_temperature: float) -> float:
        scaled = logits / math.exp(log_temperature)
        return float((np.logaddexp(0.0, scaled) - targets * scaled).mean())

    found = minimize_scalar(loss, bounds=(math.log(_COLDEST), math.log(_HOTTEST)), method="bounded")
    return Temperature(value=math.exp(float(found.x)), attempts=len(labels), source=source)


def _logits(scores: NDArray[np.float32]) -> NDArray[np.float64]:
    clipped = np.clip(scores.astype(np.float64), _ALMOST, 1 - _ALMOST)
    logits: NDArray[np.float64] = np.log(clipped) - np.log1p(-clipped)
    return logits


def _sigmoid(logits: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(0.5 * (1 + np.tanh(0.5 * logits)), dtype=np.float64)
