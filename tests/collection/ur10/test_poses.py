"""Poses that the arm is sent to, and those that it never is."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from tests.support.rig_files import write_rig_file

from handsight.collection.errors import PoseRefusedError
from handsight.collection.ur10.poses import check_pose, matrix_of, vector_of
from handsight.collection.ur10.rig import RigConfig
from handsight.collection.ur10.rig_file import load_rig
from handsight.servoing.planar import PlanarPose


@pytest.fixture
def rig(tmp_path: Path) -> RigConfig:
    return load_rig(write_rig_file(tmp_path, robot="127.0.0.2", camera="127.0.0.3", generation="cb3"))


def pose(x_m: float = 0.6, y_m: float = 0.0, yaw_deg: float = 0.0, height_m: float = 0.2) -> np.ndarray:
    return PlanarPose(x_m=x_m, y_m=y_m, angle_rad=math.radians(yaw_deg)).pose_base_tool(height_m)


def test_a_pose_survives_the_controllers_form() -> None:
    there = pose(0.55, -0.1, 77.0)
    np.testing.assert_allclose(matrix_of(vector_of(there)), there, atol=1e-12)


def test_a_pose_inside_is_let_through(rig: RigConfig) -> None:
    check_pose(rig, 0.0, pose())
    check_pose(rig, -0.1, pose(height_m=-0.09))


@pytest.mark.parametrize(
    ("wrong", "part"),
    [
        (pose(x_m=0.86), "x is 0.8600 m"),
        (pose(y_m=-0.21), "y is -0.2100 m"),
        (pose(height_m=0.002), "height is 0.0020 m"),
        (pose(height_m=0.56), "height is 0.5600 m"),
        (pose(yaw_deg=97.0), "yaw is 97.0 degrees"),
        (np.eye(4), "tilted by 180.0 degrees"),
        (pose()[:3], "expected a finite matrix"),
        (pose(x_m=math.nan), "expected a finite matrix"),
        (2 * pose(), "expected an orthonormal matrix"),
    ],
)
def test_a_pose_outside_is_refused(rig: RigConfig, wrong: np.ndarray, part: str) -> None:
    with pytest.raises(PoseRefusedError, match=part):
        check_pose(rig, 0.0, wrong)
