"""The colours of handsight's pictures, chosen once so that a colour means the same everywhere.

Predicted success runs through matplotlib's inferno from 0 (black) to 1 (pale yellow), always over the whole range:
a range fitted to each picture would make a hopeless scene look as good as an easy one.
"""

from __future__ import annotations

from typing import Final

import matplotlib as mpl
import numpy as np
from numpy.typing import ArrayLike, NDArray

Rgb = tuple[int, int, int]

HERE: Final[Rgb] = (235, 235, 235)
"""What is true of the pose where the gripper stands now."""
CHOSEN: Final[Rgb] = (64, 196, 255)
"""What the optimiser chose."""
THRESHOLD: Final[Rgb] = (239, 83, 80)
HELD: Final[Rgb] = (76, 217, 100)
EMPTY: Final[Rgb] = (255, 69, 58)
TRAJECTORY: Final[Rgb] = (224, 130, 255)
AXIS_X: Final[Rgb] = (239, 83, 80)
AXIS_Y: Final[Rgb] = (102, 187, 106)
TURN: Final[Rgb] = (92, 145, 255)
STEEL: Final[Rgb] = (120, 124, 132)
OUTLINE: Final[Rgb] = (0, 0, 0)

TALLEST_M: Final = 0.06
"""Height above the table at which the colours of depth end [m]."""
BELOW_TABLE_M: Final = 0.03
"""Depth below the table at which they begin [m], so that the table is no blank."""

OVERLAY_FULL_AT: Final = 0.3
"""Score from which the overlay has its full opacity; below it fades out, so that hopeless table stays bare."""
OVERLAY_OPACITY: Final = 0.6


def score_rgb(scores: ArrayLike) -> NDArray[np.uint8]:
    """Inferno colours of predicted success, cut at [0, 1]. (...) -> (..., 3)."""
    clipped = np.clip(np.asarray(scores, dtype=np.float64), 0.0, 1.0)
    colours: NDArray[np.uint8] = mpl.colormaps["inferno"](clipped, bytes=True)[..., :3]
    return colours


def overlay_rgba(scores: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The same colours with an opacity that grows with the score, to be laid over a picture. (R, C) -> (R, C, 4)."""
    opacity = OVERLAY_OPACITY * np.clip(scores / OVERLAY_FULL_AT, 0.0, 1.0)
    alpha = np.rint(255 * opacity).astype(np.uint8)
    return np.concatenate([score_rgb(scores), alpha[..., None]], axis=-1)
