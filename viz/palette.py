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

HELD: Final[Rgb] = (30, 120, 230)
"""Blue: what held, succeeded. Its marks are whole lines."""
EMPTY: Final[Rgb] = (226, 112, 0)
"""Orange: what came back empty, failed. Its marks are dashed, so that they are told apart without colour too."""
STEEL: Final[Rgb] = (130, 134, 142)
"""What has no label, and what is no more than there: the gripper, the table."""
HERE: Final[Rgb] = (235, 235, 235)
"""What is true of the pose where the gripper stands now, over pictures."""
CHOSEN: Final[Rgb] = (64, 196, 255)
"""What the optimiser chose."""
MEASURED: Final[Rgb] = (140, 144, 152)
"""A course that was measured, on a ground that may be light or dark."""
THRESHOLD: Final[Rgb] = (226, 112, 0)
"""A limit, as a line across a plot."""
TRAJECTORY: Final[Rgb] = (255, 214, 90)
AXIS_X: Final[Rgb] = (213, 94, 0)
AXIS_Y: Final[Rgb] = (0, 158, 115)
TURN: Final[Rgb] = (92, 145, 255)
OUTLINE: Final[Rgb] = (0, 0, 0)

SERIES_INKS: Final = ("#1b5e9e", "#d0661a", "#454545", "#00a08a", "#7a3b00", "#101040")
"""Lines of figures, on white; each has a marker and a dash of its own beside it."""
SET_INKS: Final = ("#2b67a8", "#b1560f", "#6b6f78", "#3b1e4f")
"""Bars of object sets, dark enough for white numbers; each has a hatch of its own."""
MISSED_INK: Final = "#cfd6de"
"""What is left of a bar whose other part is of the first of these."""
PAPER_INK: Final = "#111111"
"""The paper's figures, as dashed lines across bars."""

TOLD_APART: Final[dict[str, dict[str, Rgb | str]]] = {
    "labels": {"held": HELD, "empty": EMPTY, "no label": STEEL},
    "marks over a picture": {"here": HERE, "chosen": CHOSEN, "held": HELD, "empty": EMPTY},
    "scores along a servo run": {"measured": MEASURED, "predicted": CHOSEN, "threshold": THRESHOLD},
    "steps of a servo run": {"x": AXIS_X, "y": AXIS_Y, "turn": TURN},
    "the scene": {"trajectory": TRAJECTORY, "steel": STEEL, "held": HELD, "empty": EMPTY, "chosen": CHOSEN},
    "lines of a figure": {ink: ink for ink in SERIES_INKS},
    "bars of a figure": {ink: ink for ink in SET_INKS},
    "parts of a bar": {"held": SET_INKS[0], "all": MISSED_INK},
}
"""Colours that stand beside each other and mean different things; tests measure every pair, as people with
deuteranopia and protanopia see it too."""

TALLEST_M: Final = 0.06
"""Height above the table at which the colours of depth end [m]."""
BELOW_TABLE_M: Final = 0.03
"""Depth below the table at which they begin [m], so that the table is no blank."""

OVERLAY_FULL_AT: Final = 0.3
"""Score from which the overlay has its full opacity; below it fades out, so that hopeless table stays bare."""
OVERLAY_OPACITY: Final = 0.6


def ink(colour: Rgb) -> str:
    """A colour as ``#rrggbb``."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


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
