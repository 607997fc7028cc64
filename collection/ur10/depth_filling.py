"""Depth without what is out of range and without holes (section V-C: inpainted and thresholded)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

INPAINT_RADIUS_PX = 3


def filled_depth(
    raw: NDArray[np.uint16], scale_m: float, nearest_m: float, farthest_m: float
) -> tuple[NDArray[np.uint16], float]:
    """Depth with what is out of range taken out and holes inpainted, shape (H, W), and the share that was measured.

    Args:
        raw: As measured, 0 where nothing was. Shape (H, W).
        scale_m: Metres per unit.
        nearest_m: Nearer is noise.
        farthest_m: Farther is noise.
    """
    depth = raw.copy()
    depth[(depth < nearest_m / scale_m) | (depth > farthest_m / scale_m)] = 0
    holes = (depth == 0).astype(np.uint8)
    valid = 1.0 - float(holes.mean())
    if valid in (0.0, 1.0):
        return depth, valid
    filled = cv2.inpaint(depth, holes, INPAINT_RADIUS_PX, cv2.INPAINT_TELEA)
    return np.asarray(filled, dtype=np.uint16), valid
