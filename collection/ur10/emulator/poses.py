"""Poses as a controller writes them, x y z and a rotation vector, and as matrices."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.grippers import FLANGE_TO_TIP_M
from handsight.collection.sim.kinematics import flange_pose, joints_for

FLANGE_TO_TIP = np.eye(4)
FLANGE_TO_TIP[2, 3] = FLANGE_TO_TIP_M


def matrix_of(pose: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Homogeneous matrix, shape (4, 4), of a pose x y z rx ry rz [m, rad]."""
    matrix = np.eye(4)
    matrix[:3, :3] = cv2.Rodrigues(np.asarray(pose[3:], dtype=np.float64))[0]
    matrix[:3, 3] = pose[:3]
    return matrix


def vector_of(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose x y z rx ry rz [m, rad], shape (6,), of a homogeneous matrix."""
    return np.concatenate((matrix[:3, 3], cv2.Rodrigues(matrix[:3, :3])[0][:, 0]))


def inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a homogeneous matrix. Shape (4, 4)."""
    result = np.eye(4)
    result[:3, :3] = matrix[:3, :3].T
    result[:3, 3] = -matrix[:3, :3].T @ matrix[:3, 3]
    return result


def tcp_pose(joints_rad: NDArray[np.float64], tcp_offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose of the tool centre point in the base frame, which is at ``tcp_offset`` of the flange; both (4, 4)."""
    pose: NDArray[np.float64] = flange_pose(joints_rad) @ tcp_offset
    return pose


def joints_of(
    pose_base_tcp: NDArray[np.float64], tcp_offset: NDArray[np.float64], near_rad: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Joint angles [rad], (6,), that put the TCP at a pose, closest to ``near_rad``.

    Raises:
        UnreachableError: There are none.
    """
    return joints_for(pose_base_tcp @ inverse(tcp_offset) @ FLANGE_TO_TIP, near_rad)
