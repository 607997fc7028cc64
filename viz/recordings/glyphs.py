"""The marks drawn over pictures and into the scene: jaws, arrows, labels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from handsight.viz.palette import OUTLINE, STEEL, Rgb
from handsight.viz.pixels import FINGER_HALF_WIDTH_M, PictureFrame, Step, jaw_strips

STAY: Step = (0.0, 0.0, 0.0)

CONTOUR_ORDER, JAWS_ORDER, ARROW_ORDER, LABEL_ORDER = 15.0, 30.0, 40.0, 50.0
"""Draw orders over picture (0), overlay (10) and samples (20)."""

FINGER_UI = 2.2
CLOSING_UI = 0.9
CONTOUR_UI = 0.8
OUTLINE_UI = 1.3
"""Line radii in points of the screen, so that marks stay legible in small views."""

LABEL_GAP_PX = 4.0
LABEL_HEIGHT_PX = 40.0
"""Raw pixels that a label takes in the main view."""
LABEL_MARGIN_PX = 80.0
LABEL_COLOUR: Rgb = (255, 255, 255)
"""Coloured text is hard to read on the viewer's translucent labels; the jaws carry the colour."""

FINGER_HALF_THICKNESS_M = 0.006
FINGER_LENGTH_M = 0.05
PALM_HALF_SIZE_M = (0.052, 0.011, 0.011)
BODY_HALF_SIZE_M = (0.032, 0.032, 0.044)
"""Of the gripper's body, from its palm to the flange, which is 160 mm above the fingertips."""


def log_jaws(
    recording: rr.RecordingStream,
    path: str,
    frame: PictureFrame,
    step: Step,
    *,
    width_m: float,
    colour: Rgb,
    dashed: bool = False,
    static: bool = False,
    above: float = 0.0,
) -> None:
    """Log the jaws as they would stand after ``step``, outlined in black so that they show on any picture.

    The line between them is dashed where ``dashed``, as it is for grasps that failed. Jaws
    with more ``above`` lie over those with less.
    """
    strips = jaw_strips(frame, step, width_m, dashed=dashed)
    radii = np.array([FINGER_UI, FINGER_UI, *[CLOSING_UI] * (len(strips) - 2)])
    # In one entity the outline would be blended with its line: two entities, two draw orders.
    recording.log(
        f"{path}/outline",
        rr.LineStrips2D(
            strips, colors=[OUTLINE], radii=rr.Radius.ui_points(radii + OUTLINE_UI), draw_order=JAWS_ORDER + above
        ),
        static=static,
    )
    recording.log(
        f"{path}/line",
        rr.LineStrips2D(strips, colors=[colour], radii=rr.Radius.ui_points(radii), draw_order=JAWS_ORDER + above + 1),
        static=static,
    )


def log_outlined(
    recording: rr.RecordingStream,
    path: str,
    lines: Sequence[NDArray[np.float64]],
    *,
    colour: Rgb = LABEL_COLOUR,
    static: bool = False,
) -> None:
    """Log thin lines (N, 2) in Rerun pixels, black under their colour, so that they show on any picture.

    Where there are none, those of an earlier time are taken away.
    """
    for name, ink, radius, order in (
        ("outline", OUTLINE, CONTOUR_UI + OUTLINE_UI, CONTOUR_ORDER),
        ("line", colour, CONTOUR_UI, CONTOUR_ORDER + 1),
    ):
        recording.log(
            f"{path}/{name}",
            rr.LineStrips2D(lines, colors=[ink], radii=rr.Radius.ui_points([radius]), draw_order=order),
            static=static,
        )


def log_arrow(recording: rr.RecordingStream, path: str, frame: PictureFrame, step: Step, *, colour: Rgb) -> None:
    """Log an arrow from the grasp point now to the grasp point after ``step``."""
    origin, tip = frame.points([(0.0, 0.0), step[:2]])
    recording.log(
        path,
        rr.Arrows2D(
            origins=[origin],
            vectors=[tip - origin],
            colors=[colour],
            radii=rr.Radius.ui_points([2.6]),
            draw_order=ARROW_ORDER,
        ),
    )


def log_label(
    recording: rr.RecordingStream,
    path: str,
    frame: PictureFrame,
    steps: Sequence[Step],
    text: str,
    *,
    width_m: float,
    static: bool = False,
) -> None:
    """Log a text under the jaws after each of ``steps``, or over them where the picture ends.

    It is centred on the last of them.
    """
    rows_px = np.concatenate([strip for step in steps for strip in frame.jaws(step, width_m)])[:, 1]
    column_px = frame.points(steps)[-1, 0]
    height_px = frame.camera.intrinsics.height
    below_px = rows_px.max() + LABEL_GAP_PX
    row_px = below_px if below_px + LABEL_HEIGHT_PX <= height_px else rows_px.min() - LABEL_GAP_PX - LABEL_HEIGHT_PX
    margin_px = min(LABEL_MARGIN_PX, 0.5 * frame.camera.intrinsics.width)
    column_px = np.clip(column_px, margin_px, frame.camera.intrinsics.width - margin_px)
    recording.log(
        path,
        rr.Points2D(
            [[column_px, max(row_px, 0.0)]],
            radii=[0.0],
            colors=[LABEL_COLOUR],
            labels=[text],
            show_labels=True,
            draw_order=LABEL_ORDER,
        ),
        static=static,
    )


def gripper_boxes(stroke_m: float, *, colour: Rgb = STEEL) -> rr.Boxes3D:
    """Body, palm and open fingers in the tool frame: origin between the fingertips, x closing, z approach."""
    finger_x_m = 0.5 * stroke_m + FINGER_HALF_THICKNESS_M
    finger = (FINGER_HALF_THICKNESS_M, FINGER_HALF_WIDTH_M, 0.5 * FINGER_LENGTH_M)
    return rr.Boxes3D(
        centers=[
            (-finger_x_m, 0.0, -0.5 * FINGER_LENGTH_M),
            (finger_x_m, 0.0, -0.5 * FINGER_LENGTH_M),
            (0.0, 0.0, -FINGER_LENGTH_M - PALM_HALF_SIZE_M[2]),
            (0.0, 0.0, -FINGER_LENGTH_M - 2 * PALM_HALF_SIZE_M[2] - BODY_HALF_SIZE_M[2]),
        ],
        half_sizes=[finger, finger, PALM_HALF_SIZE_M, BODY_HALF_SIZE_M],
        colors=[colour],
        fill_mode="solid",
    )
