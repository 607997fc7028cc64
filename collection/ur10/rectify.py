"""Pictures as a camera would take them whose axes are parallel to the tool's.

The servo room takes camera and tool for parallel. A real clamp is off by a degree or two, and a turn about the camera's
centre is the one change of view that needs no depth.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.servoing.camera import Intrinsics
from handsight.servoing.camera_turn import CameraTurn

NO_TURN_RAD = 1e-4


class Rectifier:
    """Turns the pictures of one camera."""

    def __init__(self, intrinsics: Intrinsics, rotation_tool_camera: NDArray[np.float64]) -> None:
        """Plan the turn.

        Args:
            intrinsics: Of the camera, and of what comes out.
            rotation_tool_camera: Camera axes in the tool frame. Shape (3, 3).
        """
        self._needed = float(np.linalg.norm(cv2.Rodrigues(rotation_tool_camera)[0])) > NO_TURN_RAD
        self._turn = CameraTurn(intrinsics, rotation_tool_camera)

    def turned(self, rgb: NDArray[np.uint8], depth: NDArray[np.uint16]) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        """Both pictures turned; shapes (H, W, 3) and (H, W). What was outside has the edge's colour and no depth."""
        if not self._needed:
            return rgb, depth
        return self._turn.colours(rgb), self._turn.depths(depth)
