"""Poses as foreign sets write them, as transforms of shape (4, 4)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handsight.servoing.planar import PlanarPose

CONVENTIONS = {"xyz_rotvec": 6, "xyz_quat_wxyz": 7, "xyz_quat_xyzw": 7, "matrix": 16, "x_y_angle": 3}
"""How many numbers a pose has in each. A matrix is written row by row; an angle turns about the base's z axis."""

_TOLERANCE = 1e-2
"""Of the length of a quaternion and of the orthonormality of a matrix, which float32 and filters leave inexact."""

_LARGEST = 1e6
"""Of any number of a pose: a kilometre in millimetres. Far larger ones overflow."""


def pose_of(numbers: NDArray[np.float64], convention: str, *, unit_m: float, z_m: float) -> NDArray[np.float64]:
    """The transform that some numbers write. Lengths are in ``unit_m``; ``z_m`` is the height of planar ones.

    Raises:
        ValueError: They are no pose in that convention.
    """
    if not np.all(np.abs(numbers) <= _LARGEST):
        raise ValueError(f"pose {_shown(numbers)} is not finite, or beyond any robot")
    if convention == "x_y_angle":
        planar = PlanarPose(x_m=float(numbers[0]) * unit_m, y_m=float(numbers[1]) * unit_m, angle_rad=float(numbers[2]))
        return planar.pose_base_tool(z_m)
    if convention == "matrix":
        return _rigid(numbers.reshape(4, 4), unit_m)
    rest = numbers[3:]
    if convention == "xyz_rotvec":
        rotation = Rotation.from_rotvec(rest)
    else:
        length = float(np.linalg.norm(rest))
        if abs(length - 1) > _TOLERANCE:
            raise ValueError(f"quaternion {_shown(rest)} has length {length:.4g}, expected 1")
        rotation = Rotation.from_quat(rest, scalar_first=convention.endswith("wxyz"))
    return _transform(rotation.as_matrix(), numbers[:3] * unit_m)


def transform_of(value: object) -> NDArray[np.float64]:
    """A transform written as x, y, z [m], with a rotation vector [rad] or without, or as four rows of four.

    Raises:
        ValueError: It is written otherwise.
    """
    expected = "three numbers, six, or four rows of four"
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(expected) from error
    if numbers.shape not in ((3,), (6,), (4, 4)) or not np.all(np.isfinite(numbers)):
        raise ValueError(expected)
    if numbers.shape == (4, 4):
        return _rigid(numbers, 1.0)
    rotation = Rotation.from_rotvec(numbers[3:] if len(numbers) == 6 else np.zeros(3))
    return _transform(rotation.as_matrix(), numbers[:3])


def tilt_rad(pose: NDArray[np.float64]) -> float:
    """Angle between a frame's z axis and straight down [rad]."""
    return float(np.arccos(np.clip(-pose[2, 2], -1, 1)))


def _rigid(matrix: NDArray[np.float64], unit_m: float) -> NDArray[np.float64]:
    """A rigid transform, its rotation made orthonormal."""
    rotation = matrix[:3, :3]
    sound = np.allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=_TOLERANCE) and np.linalg.det(rotation) > 0
    if not (sound and np.allclose(matrix[3], (0, 0, 0, 1))):
        raise ValueError("a rigid transform, with an orthonormal rotation and a last row of 0 0 0 1")
    return _transform(Rotation.from_matrix(rotation).as_matrix(), matrix[:3, 3] * unit_m)


def _transform(rotation: Any, translation_m: NDArray[np.float64]) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation_m
    return pose


def _shown(numbers: NDArray[np.float64]) -> str:
    return " ".join(f"{number:.4g}" for number in numbers)
