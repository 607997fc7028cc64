"""Closed-form inverse kinematics of the UR10, kept on one branch so that the arm never flips.

Joint angles are in the order of the controller; poses are in the controller's base frame, which is turned by half a
turn against the URDF's ``base_link``.
"""

from __future__ import annotations

import numpy as np
import ur_analytic_ik_ext
from numpy.typing import NDArray

from handsight.collection.errors import UnreachableError
from handsight.collection.sim.arm_model import FLANGE_TO_TIP_M

JOINT_LIMITS_RAD = np.array([2 * np.pi, 2 * np.pi, np.pi, 2 * np.pi, 2 * np.pi, 2 * np.pi])
"""Symmetric position limits of the UR10; the elbow turns half as far as the others."""

REFERENCE_RAD = np.array([np.pi, -1.2, 1.6, -2.0, -0.5 * np.pi, 0.0])
"""Elbow up, gripper down over the workspace: the branch on which the arm stays."""

_POSE_FLANGE_TIP = np.eye(4)
_POSE_FLANGE_TIP[2, 3] = FLANGE_TO_TIP_M


def joints_for(
    pose_base_tool: NDArray[np.float64], near_rad: NDArray[np.float64], *, phase: str = "reach"
) -> NDArray[np.float64]:
    """Joint angles [rad], shape (6,), that put the fingertips at ``pose_base_tool``, closest to ``near_rad``.

    Raises:
        UnreachableError: No solution within the joint limits on the elbow-up branch.
    """
    solutions = ur_analytic_ik_ext.ur10.inverse_kinematics_with_tcp(
        np.ascontiguousarray(pose_base_tool), _POSE_FLANGE_TIP
    )
    if solutions:
        candidates = _unwrap(np.asarray(solutions), near_rad)  # (S, 6)
        reachable = candidates[(np.abs(candidates) <= JOINT_LIMITS_RAD).all(axis=1)]
        if len(reachable):
            nearest: NDArray[np.float64] = reachable[np.argmin(np.abs(reachable - near_rad).max(axis=1))]
            if _on_branch(nearest):
                return nearest
    x_m, y_m, z_m = pose_base_tool[:3, 3]
    raise UnreachableError(phase, f"the UR10 cannot put its fingertips at ({x_m:.3f}, {y_m:.3f}, {z_m:.3f}) m")


def _unwrap(solutions: NDArray[np.float64], near_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Add whole turns so that every angle lies within half a turn of ``near_rad``."""
    turns = np.round((near_rad - solutions) / (2 * np.pi))
    unwrapped: NDArray[np.float64] = solutions + 2 * np.pi * turns
    return unwrapped


def _on_branch(joints_rad: NDArray[np.float64]) -> bool:
    """Elbow up and wrist unflipped, the signs of ``REFERENCE_RAD``."""
    return bool(joints_rad[2] > 0 and joints_rad[4] < 0)
