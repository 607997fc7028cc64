"""From the tool frame to the picture: where steps, jaws and heatmaps lie in the raw pixels.

In handsight pixel (0, 0) has its centre at (0, 0); in Rerun its upper left *corner* is there. Everything drawn over a
picture is therefore moved by half a pixel, here and nowhere else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handsight.servoing.camera import HandCamera
from handsight.viz.errors import RecordingError

if TYPE_CHECKING:
    # Where a heatmap lies takes no torch, which its room imports.
    from handsight.servoing.heatmap import Heatmap

Step = tuple[float, float, float]
"""A step (dx [m], dy [m], dangle [rad]) in the tool frame."""

CENTRE_PX = 0.5
"""Centre of pixel (0, 0) in Rerun's coordinates."""
FINGER_HALF_WIDTH_M = 0.011
"""Half the width of a fingertip across the closing direction (2F-85: 22 mm)."""

DASHES = 5
"""In the line between the jaws of a grasp that failed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureFrame:
    """A hand camera over the plane on which everything is assumed to lie."""

    camera: HandCamera
    plane_m: float
    """Distance of the plane [m]."""

    def points(self, steps: ArrayLike) -> NDArray[np.float64]:
        """Where steps (dx [m], dy [m], ...) in the tool frame take the grasp point. (N, >=2) -> (N, 2), Rerun pixels.

        The translation of :func:`handsight.servoing.homography.raw_from_input`.
        """
        k = self.camera.intrinsics
        offset_m = np.array([self.camera.x_tool_camera_m, self.camera.y_tool_camera_m])
        on_plane_m = np.asarray(steps, dtype=np.float64)[:, :2] - offset_m
        points_px: NDArray[np.float64] = on_plane_m * self.pixels_per_m + (k.cx + CENTRE_PX, k.cy + CENTRE_PX)
        return points_px

    @property
    def pixels_per_m(self) -> NDArray[np.float64]:
        """Scale of the picture on the plane, along columns and rows. Shape (2,)."""
        return np.array([self.camera.intrinsics.fx, self.camera.intrinsics.fy]) / self.plane_m

    def jaws(self, step: Step, width_m: float) -> list[NDArray[np.float64]]:
        """Jaws opened by ``width_m`` after a step (dx [m], dy [m], dangle [rad]), seen from above.

        Returns:
            Three polylines in Rerun pixels, each (2, 2): the two fingertips, then the line between them.
        """
        dx_m, dy_m, dangle_rad = step
        closing = np.array([math.cos(dangle_rad), math.sin(dangle_rad)])
        across = np.array([-closing[1], closing[0]])
        centre = np.array([dx_m, dy_m])
        left, right = centre - 0.5 * width_m * closing, centre + 0.5 * width_m * closing
        reach = FINGER_HALF_WIDTH_M * across
        return [
            self.points(ends) for ends in ((left - reach, left + reach), (right - reach, right + reach), (left, right))
        ]


def jaw_strips(frame: PictureFrame, step: Step, width_m: float, *, dashed: bool) -> list[NDArray[np.float64]]:
    """The jaws of :meth:`PictureFrame.jaws`, the line between them in dashes for grasps that failed.

    Returns:
        Polylines in Rerun pixels, each (2, 2): the two fingertips, then the line between them or its dashes.
    """
    left, right, closing = frame.jaws(step, width_m)
    if not dashed:
        return [left, right, closing]
    ends = np.linspace(closing[0], closing[1], 2 * DASHES)
    return [left, right, *(ends[at : at + 2] for at in range(0, 2 * DASHES, 2))]


@dataclass(frozen=True, slots=True, kw_only=True)
class GridPlacement:
    """How the image of a heatmap, one pixel per grid point, is laid over the raw picture."""

    scale: tuple[float, float]
    """Raw pixels per grid point, along columns and rows."""
    translation_px: tuple[float, float]
    """Upper left corner of the first grid cell, in Rerun pixels."""


def place_heatmap(heatmap: Heatmap) -> GridPlacement:
    """The placement that puts the centre of every cell on the raw pixel that it scores.

    Raises:
        RecordingError: The grid is not regular, scores and grid have different shapes, or a score is not a number.
    """
    shape = (len(heatmap.rows_px), len(heatmap.columns_px))
    if heatmap.scores.shape != shape:
        raise RecordingError(f"heatmap has scores of shape {heatmap.scores.shape}, expected {shape} from its grid")
    if not np.isfinite(heatmap.scores).all():
        count = int((~np.isfinite(heatmap.scores)).sum())
        raise RecordingError(
            f"{count} of {heatmap.scores.size} scores of a heatmap are no numbers, expected all of them in [0, 1]"
        )
    scale_x, scale_y = (_spacing(axis) for axis in (heatmap.columns_px, heatmap.rows_px))
    # The centre of cell j, j + 1/2, has to come to rest on the centre of its pixel, columns_px[j] + 1/2.
    return GridPlacement(
        scale=(scale_x, scale_y),
        translation_px=(
            float(heatmap.columns_px[0]) + CENTRE_PX - 0.5 * scale_x,
            float(heatmap.rows_px[0]) + CENTRE_PX - 0.5 * scale_y,
        ),
    )


def best_step(heatmap: Heatmap, frame: PictureFrame) -> Step:
    """The step (dx [m], dy [m], dangle [rad]) to the best place of a heatmap.

    The inverse of :meth:`PictureFrame.points`.
    """
    row, column = np.unravel_index(int(np.argmax(heatmap.scores)), heatmap.scores.shape)
    camera, k = frame.camera, frame.camera.intrinsics
    scale_x, scale_y = frame.pixels_per_m.tolist()
    dx_m = (float(heatmap.columns_px[column]) - k.cx) / scale_x + camera.x_tool_camera_m
    dy_m = (float(heatmap.rows_px[row]) - k.cy) / scale_y + camera.y_tool_camera_m
    return dx_m, dy_m, heatmap.angle_rad


def _spacing(axis_px: NDArray[np.float32]) -> float:
    gaps = np.diff(axis_px.astype(np.float64))
    if not len(gaps) or gaps.min() <= 0 or np.ptp(gaps) > 1e-3:
        raise RecordingError(
            f"heatmap grid has points at {axis_px.tolist()} px, expected at least two, ascending and evenly spaced"
        )
    return float(gaps.mean())
