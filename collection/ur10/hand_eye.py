"""Where a camera sits on the tool, from views of a ChArUco board that lies still (Park and Martin 1994).

With A the motion of the tool and B that of the board in the camera between two views, A X = X B. The rotation is the
orthogonal matrix nearest to the sum of the outer products of their rotation vectors; the translation follows by least
squares. All pairs of views are taken. Residuals are told by what the answer is for: how well the board stays where it
is in the base frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import RigSettingsError
from handsight.collection.ur10.rig import BoardConfig
from handsight.datasets.errors import counted
from handsight.servoing.camera import Intrinsics

LEAST_VIEWS = 6
LEAST_CORNERS = 8
LEAST_TURN_RAD = 0.1
"""Pairs of views that turn less against each other tell nothing of the rotation."""

Pose = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class HandEye:
    """The answer, and how far the views disagree with it."""

    pose_tool_camera: Pose
    """Shape (4, 4)."""
    residual_m: float
    residual_rad: float


def board_pose(rgb: NDArray[np.uint8], intrinsics: Intrinsics, config: BoardConfig) -> Pose | None:
    """Pose of the board in the camera frame, (4, 4); None where too little of it is seen.

    Args:
        rgb: A picture without distortion. Shape (H, W, 3).
        intrinsics: Of the camera.
        config: The board.
    """
    words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, config.dictionary))
    board = cv2.aruco.CharucoBoard((config.columns, config.rows), config.square_m, config.marker_m, words)
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    found_corners: tuple[Any, Any, Any, Any] = cv2.aruco.CharucoDetector(board).detectBoard(grey)
    corners, ids = found_corners[:2]
    if ids is None or len(ids) < LEAST_CORNERS:
        return None
    points, pixels = board.matchImagePoints(corners, ids)
    found, rotation, translation = cv2.solvePnP(points, pixels, intrinsics.matrix(), np.zeros(5))
    if not found:
        return None
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(rotation)[0]
    pose[:3, 3] = np.asarray(translation)[:, 0]
    return pose


def solve_hand_eye(poses_base_tool: Sequence[Pose], poses_camera_board: Sequence[Pose]) -> HandEye:
    """The camera in the tool frame from views of a board.

    Args:
        poses_base_tool: Tool in the base frame for each view. Each (4, 4).
        poses_camera_board: Board in the camera frame for each view. Each (4, 4).

    Raises:
        RigSettingsError: Too few views, or views that hardly turn.
    """
    if len(poses_base_tool) < LEAST_VIEWS:
        raise RigSettingsError(
            f"the board was seen in {counted(len(poses_base_tool), 'view')}, expected at least {LEAST_VIEWS}: "
            "light it evenly, and lay it in the middle of the workspace"
        )
    pairs = [
        (_inverse(poses_base_tool[j]) @ poses_base_tool[i], poses_camera_board[j] @ _inverse(poses_camera_board[i]))
        for i, j in combinations(range(len(poses_base_tool)), 2)
    ]
    turning = [(a, b) for a, b in pairs if np.linalg.norm(_log(a)) > LEAST_TURN_RAD]
    axes = np.array([_log(a) for a, _ in turning]).reshape(-1, 3)
    if np.linalg.matrix_rank(axes, tol=LEAST_TURN_RAD) < 2:
        raise RigSettingsError("the views turn about one axis only: tilt the camera to several sides")
    moment = sum((np.outer(_log(b), _log(a)) for a, b in turning), np.zeros((3, 3)))
    u, _, vt = np.linalg.svd(moment)
    rotation = vt.T @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(vt.T @ u.T)))]) @ u.T
    left = np.concatenate([a[:3, :3] - np.eye(3) for a, _ in pairs])
    right = np.concatenate([rotation @ b[:3, 3] - a[:3, 3] for a, b in pairs])
    answer = np.eye(4)
    answer[:3, :3] = rotation
    answer[:3, 3] = np.linalg.lstsq(left, right, rcond=None)[0]
    return _with_residuals(answer, poses_base_tool, poses_camera_board)


def _with_residuals(answer: Pose, poses_base_tool: Sequence[Pose], poses_camera_board: Sequence[Pose]) -> HandEye:
    boards = [tool @ answer @ board for tool, board in zip(poses_base_tool, poses_camera_board, strict=True)]
    places = np.array([board[:3, 3] for board in boards])
    offsets = places - places.mean(axis=0)
    middle = boards[0][:3, :3]
    turns = np.array([_log_rotation(middle.T @ board[:3, :3]) for board in boards])
    turns = turns - turns.mean(axis=0)
    return HandEye(
        pose_tool_camera=answer,
        residual_m=float(np.sqrt((offsets**2).sum(axis=1).mean())),
        residual_rad=float(np.sqrt((turns**2).sum(axis=1).mean())),
    )


def _log(pose: Pose) -> NDArray[np.float64]:
    return _log_rotation(pose[:3, :3])


def _log_rotation(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)[:, 0]


def _inverse(pose: Pose) -> Pose:
    inverse = np.eye(4)
    inverse[:3, :3] = pose[:3, :3].T
    inverse[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return inverse
