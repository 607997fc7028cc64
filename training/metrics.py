"""How well predicted success separates good grasps from bad ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handsight.servoing.scores import check_scores

_SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")


@dataclass(frozen=True, slots=True, kw_only=True)
class Metrics:
    """Quality of predictions on attempts with known labels."""

    attempts: int
    accuracy: float | None
    """Balanced accuracy at S > 0.5, as for the balanced test sets of section VI-B; None with one class only."""
    auc: float | None
    """Area under the ROC curve: how often a success scores above a failure; None with one class only."""
    loss: float | None
    """Mean binary cross-entropy; None without attempts."""


def evaluate_scores(scores: NDArray[np.float32], labels: NDArray[np.float32]) -> Metrics:
    """Compare predicted success in [0, 1], shape (N,), with labels 0 or 1, shape (N,).

    Raises:
        ScoreError: There is not one score for each label, or some are not in [0, 1].
    """
    check_scores(scores, len(labels))
    good = labels > 0.5
    clipped = np.clip(scores.astype(np.float64), 1e-7, 1 - 1e-7)
    loss = -float(np.where(good, np.log(clipped), np.log1p(-clipped)).mean()) if len(labels) else None
    accuracy: float | None = None
    auc: float | None = None
    if good.any() and not good.all():
        accuracy = 0.5 * float((scores[good] > 0.5).mean() + (scores[~good] <= 0.5).mean())
        # Mann and Whitney: pairs of a success and a failure in which the success scores higher, of equals half.
        failures = np.sort(scores[~good])
        beaten = sum(int(np.searchsorted(failures, scores[good], side).sum()) for side in _SIDES)
        auc = beaten / (2 * int(good.sum()) * len(failures))
    return Metrics(attempts=len(labels), accuracy=accuracy, auc=auc, loss=loss)
