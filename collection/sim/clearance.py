"""The clear space under the open hand, by rays: where a descent should begin to be careful.

The simulator knows what lies below. A robot does not, but has what stands for it: it stops within a millimetre of the
first touch, which position-controlled motors in a simulation do not.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.grippers import Gripper

RAY_SPACING_M = 0.006
"""Rays are at most so far apart: closer than the thinnest objects are wide."""
BELOW_TIPS_M = 1e-3
"""Rays begin this far below the fingertips, so that none meets the hand itself."""


def first_touch_m(bullet: BulletClient, gripper: Gripper, pose_base_tool: NDArray[np.float64]) -> float:
    """Height of the fingertips [m] at which the open hand, going straight down, would first touch something.

    Args:
        bullet: The world.
        gripper: The hand.
        pose_base_tool: Pose of the fingertips above everything, pointing down. Shape (4, 4).
    """
    starts_m, above_tip_m = _footprint(gripper)
    starts_m = starts_m @ pose_base_tool[:3, :3].T + pose_base_tool[:3, 3]
    ends_m = starts_m.copy()
    ends_m[:, 2] = 0.0
    # One thread: several wait for each other longer than so few rays take.
    hits = bullet.rayTestBatch(starts_m.tolist(), ends_m.tolist(), numThreads=1)
    heights_m = np.array([hit[3][2] if hit[0] >= 0 else 0.0 for hit in hits])
    return float((heights_m - above_tip_m).max())


@lru_cache
def _footprint(gripper: Gripper) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where rays start in the tool frame, shape (R, 3), and how far above the tips is what they stand for, (R,) [m]."""
    thickness_m, width_m, length_m = gripper.finger_m
    middle_m = 0.5 * (gripper.stroke_m + thickness_m)
    boxes = [
        (-middle_m, thickness_m, width_m, 0.0),
        (middle_m, thickness_m, width_m, 0.0),
        (0.0, *gripper.palm_m[:2], length_m),
    ]
    starts, above = [], []
    for centre_m, size_x_m, size_y_m, above_m in boxes:
        for x_m in _spread(size_x_m):
            for y_m in _spread(size_y_m):
                starts.append((centre_m + x_m, y_m, BELOW_TIPS_M))
                above.append(above_m)
    return np.array(starts), np.array(above)


def _spread(size_m: float) -> NDArray[np.float64]:
    """Places across a size, both edges among them, at most ``RAY_SPACING_M`` apart. Shape (K,)."""
    return np.linspace(-0.5 * size_m, 0.5 * size_m, math.ceil(size_m / RAY_SPACING_M) + 1)
