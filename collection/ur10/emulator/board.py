"""A ChArUco board that lies on the emulated table, drawn sharper than the table's texture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.table import plane_depth_m, table_homography
from handsight.servoing.camera import Intrinsics

PX_PER_SQUARE = 64
NEAR_TABLE_M = 0.004
"""Depth that differs by more from the table's is that of something on the board."""


@dataclass(frozen=True)
class Board:
    """A printed board of squares, with its middle at a point of the table."""

    columns: int = 7
    rows: int = 5
    square_m: float = 0.03
    marker_m: float = 0.022
    dictionary: str = "DICT_4X4_50"
    x_m: float = 0.65
    y_m: float = 0.0
    angle_rad: float = 0.0
    """Direction of the board's columns about the base's upward z axis."""

    @cached_property
    def print(self) -> NDArray[np.uint8]:
        """The board as it is printed, without a margin."""
        words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_m, self.marker_m, words)
        size = (PX_PER_SQUARE * self.columns, PX_PER_SQUARE * self.rows)
        return np.asarray(board.generateImage(size, marginSize=0, borderBits=1), dtype=np.uint8)

    def lay(
        self,
        rgb: NDArray[np.uint8],
        depth: NDArray[np.uint16],
        intrinsics: Intrinsics,
        pose_base_camera: NDArray[np.float64],
        depth_scale_m: float,
    ) -> None:
        """Draw it into a picture, under whatever lies on it. ``rgb`` (H, W, 3) is changed, ``depth`` (H, W) read."""
        cos, sin, m_per_px = math.cos(self.angle_rad), math.sin(self.angle_rad), self.square_m / PX_PER_SQUARE
        half_x_m, half_y_m = 0.5 * self.columns * self.square_m, 0.5 * self.rows * self.square_m
        # Rows of the print run against y, so that it is read from above and not in a mirror.
        table_from_print = np.array(
            [
                [cos * m_per_px, sin * m_per_px, self.x_m - cos * half_x_m - sin * half_y_m],
                [sin * m_per_px, -cos * m_per_px, self.y_m - sin * half_x_m + cos * half_y_m],
                [0.0, 0.0, 1.0],
            ]
        )
        pixel_from_print = table_homography(intrinsics, pose_base_camera) @ table_from_print
        size = (intrinsics.width, intrinsics.height)
        drawn = cv2.warpPerspective(self.print, pixel_from_print, size, flags=cv2.INTER_AREA, borderValue=0)
        inside = cv2.warpPerspective(np.full_like(self.print, 255), pixel_from_print, size, flags=cv2.INTER_NEAREST)
        table_m = plane_depth_m(intrinsics, pose_base_camera)
        free = np.abs(depth * depth_scale_m - table_m) < NEAR_TABLE_M + 0.01 * table_m
        seen = (inside > 0) & (free | (depth == 0))
        rgb[seen] = np.asarray(drawn)[seen][:, None]
