"""What hangs on the flange, weighed by the arm's own sensor: mass and centre of mass.

The controller subtracts the weight of the payload that it was told of. What is left, in base axes at poses i with the
tool turned by R_i, is the sensor's offset, which turns along, and the weight of what it was not told of, which stays:

    F_i = R_i b + d g                     force  [N]
    T_i = R_i t + (R_i p) x g             torque about the tool [N m]

with g = (0, 0, -9.81), the unknown mass d and its first moment p about the tool, in tool axes. Both are linear.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import RigSettingsError
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.calibration import PayloadCalibration, today
from handsight.collection.ur10.poses import matrix_of
from handsight.collection.ur10.rig import RigConfig, RobotConfig
from handsight.servoing.planar import PlanarPose

GRAVITY_M_S2 = np.array([0.0, 0.0, -9.81])
TILT_RAD = math.radians(20.0)
MOST_TILT_RAD = math.radians(25.0)
HEIGHT_M = 0.35
SIDES = 6
SPEED_M_S = 0.2
READINGS = 60
"""Averaged at each pose."""
MOST_RESIDUAL_N = 1.5
MOST_RESIDUAL_NM = 0.3
MOST_KG = 10.0
"""What a UR10 carries."""


def calibrate_payload(arm: Arm) -> PayloadCalibration:
    """Hold the empty tool still at several tilts, and solve for what it weighs.

    Raises:
        RigSettingsError: The arm has no sensor, or its readings fit no weight.
        DeviceError: The arm fails.
    """
    robot = arm.rig.robot
    if robot.generation != "e-series":
        raise RigSettingsError(
            f"a {robot.generation} has no force sensor to weigh with: weigh gripper, camera and cables, and write "
            "payload_kg and centre_of_mass_m into [robot] of rig.toml"
        )
    rotations, forces_n, torques_nm = [], [], []
    for pose in weighing_poses(arm.rig):
        arm.move_to(pose, speed_m_s=SPEED_M_S, most_tilt_rad=MOST_TILT_RAD)
        states = [arm.state() for _ in range(READINGS)]
        rotations.append(matrix_of(list(states[-1].tcp_pose))[:3, :3])
        forces_n.append(np.mean([state.force_n for state in states], axis=0))
        torques_nm.append(np.mean([state.torque_nm for state in states], axis=0))
    return solve_payload(robot, rotations, forces_n, torques_nm)


def weighing_poses(rig: RigConfig) -> Iterator[NDArray[np.float64]]:
    """Tool poses over the middle of the workspace, (4, 4): upright, and tilted to several sides."""
    x_m, y_m = rig.workspace.centre_m
    for side in range(SIDES + 1):
        yaw_rad = math.radians((-40.0, 0.0, 40.0)[side % 3])
        pose = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=yaw_rad).pose_base_tool(HEIGHT_M)
        if side < SIDES:
            direction_rad = 2 * math.pi * side / SIDES
            axis = TILT_RAD * np.array([math.cos(direction_rad), math.sin(direction_rad), 0.0])
            pose[:3, :3] = np.asarray(cv2.Rodrigues(axis)[0]) @ pose[:3, :3]
        yield pose


def solve_payload(
    robot: RobotConfig,
    rotations: Sequence[NDArray[np.float64]],
    forces_n: Sequence[NDArray[np.float64]],
    torques_nm: Sequence[NDArray[np.float64]],
) -> PayloadCalibration:
    """Mass and centre of mass by least squares.

    Args:
        robot: What the controller was told.
        rotations: Tool axes in the base frame, each (3, 3).
        forces_n: Readings in base axes, each (3,).
        torques_nm: Readings about the tool in base axes, each (3,).

    Raises:
        RigSettingsError: They fit no weight, or one that no UR10 carries.
    """
    turned = np.concatenate(rotations)  # (3 N, 3)
    weight = np.tile(GRAVITY_M_S2, len(rotations))[:, None]
    # (R p) x g = -[g]x R p
    levers = np.concatenate([-_cross(GRAVITY_M_S2) @ rotation for rotation in rotations])
    force, force_residual_n = _solved(np.hstack((turned, weight)), np.concatenate(forces_n))
    torque, torque_residual_nm = _solved(np.hstack((turned, levers)), np.concatenate(torques_nm))
    mass_kg = robot.payload_kg + float(force[3])
    faults = []
    if not 0 < mass_kg <= MOST_KG:
        faults.append(f"the payload would weigh {mass_kg:.2f} kg, expected above 0 and at most {MOST_KG:g}")
    if force_residual_n > MOST_RESIDUAL_N or torque_residual_nm > MOST_RESIDUAL_NM:
        faults.append(
            f"readings are {force_residual_n:.1f} N and {torque_residual_nm:.2f} N m off any weight, expected at most "
            f"{MOST_RESIDUAL_N:g} N and {MOST_RESIDUAL_NM:g} N m"
        )
    if faults:
        raise RigSettingsError(
            f"{'; '.join(faults)}: let nothing touch the tool or pull at its cables, and empty the jaws"
        )
    tool_m = np.array([0.0, 0.0, robot.tcp_length_m])
    told_kg_m = robot.payload_kg * (np.asarray(robot.centre_of_mass_m) - tool_m)
    x_m, y_m, z_m = (float(value) for value in tool_m + (torque[3:] + told_kg_m) / mass_kg)
    return PayloadCalibration(
        date=today(),
        mass_kg=mass_kg,
        centre_of_mass_m=(x_m, y_m, z_m),
        told_kg=robot.payload_kg,
        residual_n=force_residual_n,
        residual_nm=torque_residual_nm,
        poses=len(rotations),
    )


def _solved(design: NDArray[np.float64], readings: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """The least-squares answer, and the RMS of what it leaves."""
    answer = np.asarray(np.linalg.lstsq(design, readings, rcond=None)[0], dtype=np.float64)
    return answer, float(np.sqrt(np.mean((design @ answer - readings) ** 2)))


def _cross(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """The matrix of the cross product with a vector from the left. Shape (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
