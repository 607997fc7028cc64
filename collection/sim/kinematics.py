"""Closed-form inverse kinematics of the UR10, kept on one branch so that the arm never flips.

Joint angles are in the order of the controller; poses are in the controller's base frame, which is turned by half a
turn against the URDF's ``base_link``.
"""

from __future__ import annotations

import numpy as np
from eaik.IK_DH import DhRobot
from numpy.typing import NDArray

from handsight.collection.errors import UnreachableError
from handsight.collection.sim.grippers import FLANGE_TO_TIP_M

JOINT_LIMITS_RAD = np.array([2 * np.pi, 2 * np.pi, np.pi, 2 * np.pi, 2 * np.pi, 2 * np.pi])
"""Symmetric position limits of the UR10; the elbow turns half as far as the others."""

REFERENCE_RAD = np.array([np.pi, -1.2, 1.6, -2.0, -0.5 * np.pi, 0.0])
"""Elbow up, gripper down over the workspace: the branch on which the arm stays."""

TIE_SHARE = 1e-6
"""Weight of the shoulder's turn beside that of the joint that turns farthest."""

UPPER_ARM_M, FOREARM_M = 0.612, 0.5723

# Denavit-Hartenberg parameters as Universal Robots publishes them for the UR10 ("DH Parameters for calculations of
# kinematics and dynamics"). The first frame is the controller's base frame, the last one the flange.
_UR10 = DhRobot(
    dh_alpha=np.array([0.5 * np.pi, 0.0, 0.0, 0.5 * np.pi, -0.5 * np.pi, 0.0]),  # rad
    dh_a=np.array([0.0, -UPPER_ARM_M, -FOREARM_M, 0.0, 0.0, 0.0]),  # m
    dh_d=np.array([0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922]),  # m
)


def joints_for(
    pose_base_tool: NDArray[np.float64], near_rad: NDArray[np.float64], *, phase: str = "reach"
) -> NDArray[np.float64]:
    """Joint angles [rad], shape (6,), that put the fingertips at ``pose_base_tool``, closest to ``near_rad``.

    Raises:
        UnreachableError: No solution within the joint limits that reaches forward with the elbow up.
    """
    candidates = _unwrap(_solutions(pose_base_tool), near_rad)  # (S, 6)
    within = (np.abs(candidates) <= JOINT_LIMITS_RAD).all(axis=1) & _reaches_forward(candidates)
    reachable = candidates[within]
    if len(reachable):
        travel_rad = np.abs(reachable - near_rad)
        # The joint that turns farthest decides, among two elbows with the same shoulder and wrist the solver's order,
        # elbow up first. By symmetry two shoulders can tie too, at y = 0 with the jaws along y for instance, up to the
        # last bit: then the one that turns less.
        cost_rad = travel_rad.max(axis=1) + TIE_SHARE * travel_rad[:, 0]
        nearest: NDArray[np.float64] = reachable[np.argmin(cost_rad)]
        if _on_branch(nearest):
            return nearest
    x_m, y_m, z_m = pose_base_tool[:3, 3]
    raise UnreachableError(phase, f"the UR10 cannot put its fingertips at ({x_m:.3f}, {y_m:.3f}, {z_m:.3f}) m")


def _solutions(pose_base_tool: NDArray[np.float64]) -> NDArray[np.float64]:
    """All joint angles [rad] that put the fingertips at a pose, each up to whole turns. Shape (S, 6), S from 0 to 8."""
    pose_base_flange = pose_base_tool.copy()
    pose_base_flange[:3, 3] -= FLANGE_TO_TIP_M * pose_base_tool[:3, 2]
    answer = _UR10.IK(pose_base_flange)
    # Out of reach the solver still answers, with joints that come as close as the arm can, and marks them.
    exact = ~np.asarray(answer.is_LS, dtype=bool)
    solutions: NDArray[np.float64] = np.reshape(answer.Q, (-1, 6))[exact]
    return solutions


def _unwrap(solutions: NDArray[np.float64], near_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Add whole turns so that every angle lies within half a turn of ``near_rad``."""
    turns = np.round((near_rad - solutions) / (2 * np.pi))
    unwrapped: NDArray[np.float64] = solutions + 2 * np.pi * turns
    return unwrapped


def _reaches_forward(joints_rad: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the wrist is on the side that the shoulder faces. Shapes (S, 6), (S,).

    Bent backwards over its shoulder the arm reaches the same poses, with the upper arm down on the table.
    """
    reach_m: NDArray[np.float64] = UPPER_ARM_M * np.cos(joints_rad[:, 1]) + FOREARM_M * np.cos(
        joints_rad[:, 1] + joints_rad[:, 2]
    )
    return reach_m > 0


def _on_branch(joints_rad: NDArray[np.float64]) -> bool:
    """Elbow up and wrist unflipped, the signs of ``REFERENCE_RAD``."""
    return bool(joints_rad[2] > 0 and joints_rad[4] < 0)


def flange_pose(joints_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose of the flange in the base frame at these joint angles [rad], shape (6,). Shape (4, 4)."""
    pose_base_flange: NDArray[np.float64] = np.asarray(_UR10.fwdKin(joints_rad), dtype=np.float64)
    return pose_base_flange
