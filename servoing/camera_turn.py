"""The picture that a camera would have taken had it been turned about its centre.

A turn about the centre of a pinhole camera moves every pixel by one homography, K R K^-1, however far away what it
shows is (Hartley & Zisserman, section 8.4.2): nothing hides behind anything else than before. Depth is measured along
the optical axis, which turns too, so that it changes by a factor that the pixel alone decides.
"""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.servoing.camera import Intrinsics

Depth = TypeVar("Depth", np.uint16, np.float32)


class CameraTurn:
    """One turn of one camera, planned once for all of its pictures."""

    def __init__(self, intrinsics: Intrinsics, rotation_turned_camera: NDArray[np.float64]) -> None:
        """Plan the turn.

        Args:
            intrinsics: Of the camera before and after the turn.
            rotation_turned_camera: Takes directions from the axes of the camera (x right, y down, z forward) to those
                of the turned one. Shape (3, 3).
        """
        k, matrix = intrinsics, intrinsics.matrix()
        self._homography = matrix @ rotation_turned_camera @ np.linalg.inv(matrix)
        self._size = (k.width, k.height)
        x = (np.arange(k.width) - k.cx) / k.fx  # (W,)
        y = (np.arange(k.height) - k.cy) / k.fy  # (H,)
        # R^T r is the ray r of the turned camera in the axes of the camera. At depth z a point is z / (R^T r)_z along
        # it, which is its new depth, as the third coordinate of r is 1.
        forward = rotation_turned_camera[0, 2] * x + (rotation_turned_camera[1, 2] * y)[:, None]
        forward += rotation_turned_camera[2, 2]
        # The camera saw nothing of what lies behind it.
        self._factor = np.divide(1.0, forward, out=np.zeros_like(forward), where=forward > 0).astype(np.float32)

    def colours(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Colours turned; what was outside takes the colour of the edge. (H, W, 3) -> (H, W, 3)."""
        turned = cv2.warpPerspective(
            rgb, self._homography, self._size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(turned, dtype=np.uint8)

    def depths(self, depth: NDArray[Depth]) -> NDArray[Depth]:
        """Depths turned, in the same unit and type; 0, which is none, for what had none and what was outside.

        They are never mixed across an edge: between an object and the table there is nothing. (H, W) -> (H, W).
        """
        turned = cv2.warpPerspective(depth, self._homography, self._size, flags=cv2.INTER_NEAREST) * self._factor
        if depth.dtype == np.uint16:
            turned = np.minimum(np.rint(turned), np.iinfo(np.uint16).max)
        in_its_type: NDArray[Depth] = turned.astype(depth.dtype)
        return in_its_type
