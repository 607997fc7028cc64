"""Jaws and frames over pictures, for every figure that shows what a camera saw."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.patheffects import withStroke

from handsight.servoing.camera import Intrinsics
from handsight.viz import palette
from handsight.viz.pixels import CENTRE_PX, PictureFrame, Step, jaw_strips

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH_PX: Final = 1200
DPI: Final = 150
GAP_PX: Final = 8


def draw_jaws(
    axes: Axes, frame: PictureFrame, step: Step, *, width_m: float, colour: palette.Rgb, dashed: bool = False
) -> None:
    """Draw the jaws, opened by ``width_m``, after a step (dx [m], dy [m], dangle [rad]) over a picture.

    The line between them is dashed where ``dashed``, as it is for grasps that failed.
    """
    outline = [withStroke(linewidth=4.2, foreground="black")]
    for number, strip in enumerate(jaw_strips(frame, step, width_m, dashed=dashed)):
        # Matplotlib counts pixels from their centres, as handsight does.
        column_px, row_px = (strip - CENTRE_PX).T
        axes.plot(
            column_px,
            row_px,
            color=np.array(colour) / 255,
            linewidth=1.2 if number >= 2 else 2.6,
            solid_capstyle="butt" if dashed and number >= 2 else "round",
            path_effects=outline if number < 2 else [withStroke(linewidth=2.6, foreground="black")],
        )


def frame_picture(axes: Axes, k: Intrinsics) -> None:
    """Cut everything drawn at the edges of the picture, and leave out the axes."""
    axes.set_xlim(-CENTRE_PX, k.width - CENTRE_PX)
    axes.set_ylim(k.height - CENTRE_PX, -CENTRE_PX)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
