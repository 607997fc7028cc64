"""Predicted success as every room takes it: a number in [0, 1], or a network that is not to be trusted.

A score that is not a number compares as neither good nor bad, so it would end a servo run at once, or be chosen among
better ones. Scores are therefore checked where they come from, and no grasp follows from any of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.servoing.errors import ScoreError


def check_scores(scores: NDArray[Any], count: int) -> None:
    """Refuse what is not one success metric S in [0, 1] for each of ``count`` inputs.

    Raises:
        ScoreError: There is another number of scores, or some are not in [0, 1]; the message says how many.
    """
    if scores.shape != (count,):
        raise ScoreError(f"a network gave scores of shape {scores.shape}, expected ({count},): one for each input")
    good = (scores >= 0) & (scores <= 1)  # False for what is not a number.
    if not good.all():
        raise ScoreError(
            f"{count - int(good.sum())} of {count} score{'s' * (count != 1)} of a network are not in [0, 1] "
            f"({_found(scores[~good])}), expected all: its weights or its inputs are damaged, or its training "
            "diverged; look at the run, or train again"
        )


def _found(bad: NDArray[Any]) -> str:
    """What the scores out of range are, such as ``2 NaN, the others from -0.5 to 3``."""
    missing = int(np.isnan(bad).sum())
    numbers = bad[~np.isnan(bad)]
    if not len(numbers):
        return f"{missing} NaN"
    span = f"from {numbers.min():.3g} to {numbers.max():.3g}"
    return f"{missing} NaN, the others {span}" if missing else span
