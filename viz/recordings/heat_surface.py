"""Heat in three dimensions: the surface that a camera saw, in the colours of a heatmap.

The table lies where the network assumes it, at the mean depth. The frame is the tool's, turned up: x along the closing
direction of the jaws, y away from the camera's down, z above the table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from handsight.servoing.heatmap import Heatmap
from handsight.servoing.view import View
from handsight.viz.heat_look import muted, with_heat
from handsight.viz.palette import Rgb
from handsight.viz.pixels import FINGER_HALF_WIDTH_M, Step

STRIDE_PX = 6
"""Raw pixels between vertices: about as many as a heatmap has points."""
OVER_M = 0.06
"""Height at which the jaws are drawn, above most objects [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatSurface:
    """A grid of vertices over a picture."""

    points_m: NDArray[np.float32]
    """Shape (R, C, 3)."""
    rgb: NDArray[np.uint8]
    """The muted picture there. Shape (R, C, 3)."""
    columns_px: NDArray[np.float32]
    rows_px: NDArray[np.float32]

    @classmethod
    def of(cls, view: View) -> HeatSurface:
        """The surface in a picture; where no depth was measured it lies on the table."""
        k, plane_m = view.camera.intrinsics, view.plane_m
        columns_px = np.arange(0, k.width, STRIDE_PX, dtype=np.float32)
        rows_px = np.arange(0, k.height, STRIDE_PX, dtype=np.float32)
        rows, columns = np.ix_(rows_px.astype(int), columns_px.astype(int))
        depth_m = np.where(view.valid, view.depth_m, plane_m)[rows, columns]  # (R, C)
        x_m = (columns_px - k.cx)[None] * depth_m / k.fx + view.camera.x_tool_camera_m
        y_m = (rows_px - k.cy)[:, None] * depth_m / k.fy + view.camera.y_tool_camera_m
        points_m = np.stack([x_m, -y_m, plane_m - depth_m], axis=-1).astype(np.float32)
        return cls(points_m=points_m, rgb=muted(view.rgb)[rows, columns], columns_px=columns_px, rows_px=rows_px)

    def log_shape(self, stream: rr.RecordingStream, path: str) -> None:
        """Log what is the same at every angle."""
        rows, columns = self.rgb.shape[:2]
        corner = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
        upper = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:]], axis=-1)
        lower = np.stack([corner[:-1, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1)
        triangles = np.concatenate([upper.reshape(-1, 3), lower.reshape(-1, 3)])
        stream.log(
            path, rr.Mesh3D(vertex_positions=self.points_m.reshape(-1, 3), triangle_indices=triangles), static=True
        )

    def log_heat(self, stream: rr.RecordingStream, path: str, heatmap: Heatmap) -> None:
        """Log its colours under a heatmap."""
        colours = with_heat(self.rgb, self._scores(heatmap))
        stream.log(path, rr.Mesh3D.from_fields(vertex_colors=colours.reshape(-1, 3)))

    def log_jaws(self, stream: rr.RecordingStream, path: str, step: Step, *, width_m: float, colour: Rgb) -> None:
        """Log the jaws after a step, hovering over the table."""
        dx_m, dy_m, dangle_rad = step
        along = np.array([math.cos(dangle_rad), -math.sin(dangle_rad), 0.0])
        across = np.array([along[1], -along[0], 0.0])
        centre = np.array([dx_m, -dy_m, OVER_M])
        left, right = centre - 0.5 * width_m * along, centre + 0.5 * width_m * along
        reach = FINGER_HALF_WIDTH_M * across
        strips = [[left - reach, left + reach], [right - reach, right + reach], [left, right]]
        strips += [[end, end * (1.0, 1.0, 0.0)] for end in (left, right)]
        stream.log(path, rr.LineStrips3D(strips, colors=[colour], radii=[0.003, 0.003, 0.0012, 0.0008, 0.0008]))

    def _scores(self, heatmap: Heatmap) -> NDArray[np.float32]:
        """Scores at the vertices, between points of the map. Shape (R, C)."""
        column = _places(self.columns_px, heatmap.columns_px)
        row = _places(self.rows_px, heatmap.rows_px)
        at_row, at_column = (grid.astype(np.float32) for grid in np.meshgrid(row, column, indexing="ij"))
        read = cv2.remap(heatmap.scores, at_column, at_row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(read, dtype=np.float32)


def _places(wanted_px: NDArray[np.float32], grid_px: NDArray[np.float32]) -> NDArray[np.float32]:
    """Where raw pixels lie on a grid, counted in its points."""
    return np.asarray((wanted_px - grid_px[0]) / (grid_px[1] - grid_px[0]), dtype=np.float32)
