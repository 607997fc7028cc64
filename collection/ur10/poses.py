"""Poses as matrices and as the controller writes them: x y z and a rotation vector [m, rad]."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import PoseRefusedError
from handsight.collection.ur10.rig import RigConfig

SLACK_M = 0.002
"""What a pose may be beyond a limit: the arm's repeatability, and rounding."""
MOST_TILT_RAD = math.radians(3.0)


def vector_of(matrix: NDArray[np.float64]) -> list[float]:
    """The six numbers of a homogeneous matrix, shape (4, 4)."""
    return [*map(float, matrix[:3, 3]), *map(float, cv2.Rodrigues(matrix[:3, :3])[0][:, 0])]


def matrix_of(vector: list[float]) -> NDArray[np.float64]:
    """Homogeneous matrix, shape (4, 4), of the six numbers of a pose."""
    matrix = np.eye(4)
    matrix[:3, :3] = cv2.Rodrigues(np.asarray(vector[3:6], dtype=np.float64))[0]
    matrix[:3, 3] = vector[:3]
    return matrix


def check_pose(
    rig: RigConfig,
    table_height_m: float,
    pose_base_tool: NDArray[np.float64],
    *,
    most_tilt_rad: float = MOST_TILT_RAD,
) -> None:
    """Refuse a pose that the arm is never sent to: ill-formed, outside the workspace, tilted, or turned too far.

    Args:
        rig: The limits.
        table_height_m: Height of the table top in the base frame.
        pose_base_tool: In the controller's base frame.
        most_tilt_rad: How far the tool may be from pointing straight down.

    Raises:
        PoseRefusedError: Every fault is named.
    """
    pose = np.asarray(pose_base_tool, dtype=np.float64)
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise PoseRefusedError(f"pose of shape {pose.shape}, expected a finite matrix of shape (4, 4)")
    if not np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-6) or np.linalg.det(pose[:3, :3]) < 0:
        raise PoseRefusedError("the rotation of the pose is none: expected an orthonormal matrix")
    area = rig.workspace
    limits = (
        ("x", pose[0, 3], area.x_min_m - area.margin_m, area.x_max_m + area.margin_m),
        ("y", pose[1, 3], area.y_min_m - area.margin_m, area.y_max_m + area.margin_m),
        ("height", pose[2, 3] - table_height_m, area.clearance_m, area.overhead_height_m + area.margin_m),
    )
    faults = [
        f"{name} is {value:.4f} m, expected {low:.4f} to {high:.4f}"
        for name, value, low, high in limits
        if not low - SLACK_M <= value <= high + SLACK_M
    ]
    tilt_rad = math.acos(max(-1.0, min(1.0, -pose[2, 2])))
    if tilt_rad > most_tilt_rad:
        faults.append(
            f"the tool is tilted by {math.degrees(tilt_rad):.1f} degrees, expected at most "
            f"{math.degrees(most_tilt_rad):.0f}"
        )
    yaw_deg = math.degrees(math.atan2(pose[1, 0], pose[0, 0]))
    if not area.yaw_min_deg - 0.5 <= yaw_deg <= area.yaw_max_deg + 0.5:
        faults.append(f"yaw is {yaw_deg:.1f} degrees, expected {area.yaw_min_deg:g} to {area.yaw_max_deg:g}")
    if faults:
        raise PoseRefusedError("; ".join(faults))
