"""Measuring a rig: the camera over its board, the table by touch, the jaws by closing them on nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import DeviceError, PoseRefusedError, RigSettingsError
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.calibration import CameraCalibration, JawCalibration, TableCalibration, today
from handsight.collection.ur10.camera import Camera
from handsight.collection.ur10.gripper import Gripper
from handsight.collection.ur10.hand_eye import board_pose, solve_hand_eye
from handsight.collection.ur10.poses import matrix_of
from handsight.collection.ur10.rig import RigConfig
from handsight.servoing.planar import PlanarPose

MOST_TILT_RAD = math.radians(25.0)
TILTS_DEG = (0.0, 12.0, 20.0)
DISTANCE_M = 0.38
"""Of the camera from the board."""
VIEW_SPEED_M_S = 0.2
MOST_RESIDUAL_M = 0.003
MOST_SPREAD = 3
JAW_ROUNDS = 3
BELOW_M = 0.03
"""How far below where the table should be it is looked for."""
TOUCH_SPEEDS_M_S = (0.01, 0.002)
"""Of the touch that finds the table, and of the one that measures it."""
BACK_OFF_M = 0.003
"""How far over the first touch the second begins."""
TOUCH_FORCE_N = 15.0
MOST_TABLE_RESIDUAL_M = 0.003


def calibrate_camera(arm: Arm, camera: Camera, *, robot_serial: str) -> CameraCalibration:
    """Look at the board in the middle of the workspace from many sides, and solve.

    Raises:
        RigSettingsError: Too few views, or views that disagree.
        DeviceError: The arm or the camera fails.
    """
    rig, found = arm.rig, camera.description()
    intrinsics = found.intrinsics
    tools: list[NDArray[np.float64]] = []
    boards: list[NDArray[np.float64]] = []
    for pose in board_views(rig):
        try:
            there = arm.move_to(pose, speed_m_s=VIEW_SPEED_M_S, most_tilt_rad=MOST_TILT_RAD)
        except PoseRefusedError:
            continue  # Beside the workspace: the other views do.
        seen = board_pose(camera.picture().rgb, intrinsics, rig.board)
        if seen is not None:
            tools.append(there)
            boards.append(seen)
    answer = solve_hand_eye(tools, boards)
    if answer.residual_m > MOST_RESIDUAL_M:
        raise RigSettingsError(
            f"the board moves by {1e3 * answer.residual_m:.1f} mm between views, expected at most "
            f"{1e3 * MOST_RESIDUAL_M:g}: check [board], that the board is flat, and that nothing is loose"
        )
    rotation = cv2.Rodrigues(answer.pose_tool_camera[:3, :3])[0][:, 0]
    x_m, y_m, z_m = (float(value) for value in answer.pose_tool_camera[:3, 3])
    return CameraCalibration(
        date=today(),
        serial=found.serial,
        intrinsics=intrinsics,
        depth_scale_m=found.depth_scale_m,
        translation_m=(x_m, y_m, z_m),
        rotation_rad=(float(rotation[0]), float(rotation[1]), float(rotation[2])),
        residual_m=answer.residual_m,
        residual_rad=answer.residual_rad,
        views=len(tools),
        robot=robot_serial,
    )


def board_views(rig: RigConfig) -> Iterator[NDArray[np.float64]]:
    """Tool poses over the table, (4, 4), from which the camera looks at the middle of the workspace."""
    x_m, y_m = rig.workspace.centre_m
    mount = np.eye(4)
    mount[:3, 3] = rig.camera.mount_m
    for tilt_deg in TILTS_DEG:
        sides = 2 if tilt_deg == 0 else 6
        for side in range(sides):
            direction = 2 * math.pi * side / sides
            yaw_rad = math.radians((-40.0, 0.0, 40.0)[side % 3])
            camera = PlanarPose(x_m=0.0, y_m=0.0, angle_rad=yaw_rad).pose_base_tool(0.0)
            camera[:3, :3] = _tilted(math.radians(tilt_deg), direction) @ camera[:3, :3]
            camera[:3, 3] = np.array([x_m, y_m, 0.0]) - DISTANCE_M * camera[:3, 2]
            yield camera @ np.linalg.inv(mount)


def _tilted(angle_rad: float, direction_rad: float) -> NDArray[np.float64]:
    axis = angle_rad * np.array([math.cos(direction_rad), math.sin(direction_rad), 0.0])
    return np.asarray(cv2.Rodrigues(axis)[0], dtype=np.float64)


def calibrate_table(arm: Arm, gripper: Gripper) -> TableCalibration:
    """Touch the empty table at five points with the closed gripper, at each fast to find it and slowly to measure it.

    An arm is deeper than what it touches by what it travels until the force is told: at 2 mm/s a fifth of that at
    10 mm/s. What it travels until it stands does not count, as the height is that of the first reading over the
    threshold.

    Raises:
        RigSettingsError: The points lie in no plane.
        DeviceError: No touch where the table should be, or a device fails.
    """
    rig = arm.rig
    area = rig.workspace
    # The table is looked for a little below where it should be, which no other move may reach.
    deep = replace(
        rig,
        workspace=replace(area, clearance_m=-BELOW_M),
        motion=replace(rig.motion, contact_force_n=TOUCH_FORCE_N),
    )
    gripper.close()
    x_m, y_m = area.centre_m
    half_x_m, half_y_m = 0.45 * (area.x_max_m - area.x_min_m), 0.45 * (area.y_max_m - area.y_min_m)
    points = []
    arm.rig = deep
    try:
        for along_x, along_y in ((0, 0), (-1, -1), (1, -1), (1, 1), (-1, 1)):
            pose = PlanarPose(x_m=x_m + along_x * half_x_m, y_m=y_m + along_y * half_y_m, angle_rad=0.0)
            arm.move_to(pose.pose_base_tool(0.1))
            arm.move_to(pose.pose_base_tool(0.03), speed_m_s=0.05)
            points.append(_touched(arm, pose))
            arm.lift_straight(0.1, speed_m_s=0.1)
    finally:
        arm.rig = rig
    gripper.open()
    return _table_of(np.array(points), (x_m, y_m))


def _touched(arm: Arm, pose: PlanarPose) -> NDArray[np.float64]:
    """Where the table is touched below a pose, shape (3,), in the base frame.

    Raises:
        DeviceError: No touch where the table should be.
    """
    for speed_m_s in TOUCH_SPEEDS_M_S:
        arm.rig = replace(arm.rig, motion=replace(arm.rig.motion, descend_speed_m_s=speed_m_s))
        touch = arm.descend(pose.pose_base_tool(-BELOW_M))
        if not touch.contact:
            raise DeviceError(
                f"no table at ({pose.x_m:.2f}, {pose.y_m:.2f}) m down to {BELOW_M} m below table_height_m "
                f"{arm.table_height_m}: correct it in rig.toml"
            )
        point_m = matrix_of(list(touch.first_tcp_pose))[:3, 3]
        arm.lift_straight(float(point_m[2]) - arm.table_height_m + BACK_OFF_M, speed_m_s=0.02)
    return point_m


def _table_of(points_m: NDArray[np.float64], centre_m: tuple[float, float]) -> TableCalibration:
    """The plane through points, shape (N, 3), in the base frame."""
    offsets = points_m[:, :2] - centre_m
    design = np.column_stack((offsets, np.ones(len(points_m))))
    answer, *_ = np.linalg.lstsq(design, points_m[:, 2], rcond=None)
    residual_m = float(np.sqrt(np.mean((design @ answer - points_m[:, 2]) ** 2)))
    if residual_m > MOST_TABLE_RESIDUAL_M:
        raise RigSettingsError(
            f"the touches lie {1e3 * residual_m:.1f} mm off a plane, expected at most {1e3 * MOST_TABLE_RESIDUAL_M:g}: "
            "clear the table"
        )
    return TableCalibration(
        date=today(),
        height_m=float(answer[2]),
        tilt_rad=float(math.atan(math.hypot(answer[0], answer[1]))),
        residual_m=residual_m,
        points=len(points_m),
    )


def calibrate_jaws(gripper: Gripper, rig: RigConfig) -> JawCalibration:
    """Close the jaws on nothing a few times, and read.

    Raises:
        RigSettingsError: The readings differ from time to time.
        DeviceError: The gripper fails.
    """
    closed, opened = [], []
    for _ in range(JAW_ROUNDS):
        opened.append(gripper.open().raw)
        closed.append(gripper.close().raw)
    opened.append(gripper.open().raw)
    name = "POS" if "POS" in closed[0] else "WIDTH"
    counts = [raw[name] for raw in closed]
    spread = max(counts) - min(counts)
    if spread > MOST_SPREAD:
        raise RigSettingsError(f"the empty jaws close at {counts} counts: something is between them, or they are loose")
    return JawCalibration(
        date=today(),
        open_count=round(float(np.median([raw[name] for raw in opened]))),
        closed_count=round(float(np.median(counts))),
        spread=spread,
        pad_width_m=rig.gripper.pad_width_m,
        pad_length_m=rig.gripper.pad_length_m,
    )
