"""Pictures as a camera would take them whose axes are parallel to the tool's.

The servo room takes camera and tool for parallel. A real clamp is off by a degree or two, and a turn about the camera's
centre is the one change of view that needs no depth: a homography for the colours, the same with the new distance along
the optical axis for the depth.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.servoing.camera import Intrinsics

NO_TURN_RAD = 1e-4


class Rectifier:
    """Turns the pictures of one camera."""

    def __init__(self, intrinsics: Intrinsics, rotation_tool_camera: NDArray[np.float64]) -> None:
        """Plan the turn.

        Args:
            intrinsics: Of the camera, and of what comes out.
            rotation_tool_camera: Camera axes in the tool frame. Shape (3, 3).
        """
        k = np.array([[intrinsics.fx, 0, intrinsics.cx], [0, intrinsics.fy, intrinsics.cy], [0, 0, 1.0]])
        self._needed = float(np.linalg.norm(cv2.Rodrigues(rotation_tool_camera)[0])) > NO_TURN_RAD
        self._homography = k @ rotation_tool_camera @ np.linalg.inv(k)
        self._size = (intrinsics.width, intrinsics.height)
        columns, rows = np.meshgrid(np.arange(intrinsics.width), np.arange(intrinsics.height))
        rays = np.stack(((columns - intrinsics.cx) / intrinsics.fx, (rows - intrinsics.cy) / intrinsics.fy), axis=-1)
        # Distance along the new axis of a point at distance 1 along the old one.
        self._factor = (rays @ rotation_tool_camera[2, :2] + rotation_tool_camera[2, 2]).astype(np.float32)

    def turned(self, rgb: NDArray[np.uint8], depth: NDArray[np.uint16]) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        """Both pictures turned; shapes (H, W, 3) and (H, W). What was outside is black and without depth."""
        if not self._needed:
            return rgb, depth
        colour = cv2.warpPerspective(rgb, self._homography, self._size, flags=cv2.INTER_LINEAR)
        along = np.rint(depth * self._factor).clip(0, 65535).astype(np.uint16)
        # Neighbours at an edge are never mixed to a depth at which nothing is.
        distance = cv2.warpPerspective(along, self._homography, self._size, flags=cv2.INTER_NEAREST)
        return np.asarray(colour, dtype=np.uint8), np.asarray(distance, dtype=np.uint16)
