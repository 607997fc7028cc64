"""Weighing: exact where readings are, refused where they fit no weight, and poses that the arm may take."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from tests.support.rig_files import write_rig_file

from handsight.collection.errors import RigSettingsError
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.payload import (
    GRAVITY_M_S2,
    MOST_TILT_RAD,
    calibrate_payload,
    solve_payload,
    weighing_poses,
)
from handsight.collection.ur10.poses import check_pose
from handsight.collection.ur10.rig import RigConfig, RobotConfig
from handsight.collection.ur10.rig_file import load_rig

TOLD = RobotConfig(
    address="127.0.0.2",
    generation="e-series",
    payload_kg=1.3,
    centre_of_mass_m=(0.0, 0.0, 0.06),
    tcp_length_m=0.16,
)
centres = st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(0.0, 0.15))
offsets = st.tuples(*[st.floats(-5, 5)] * 3)


@pytest.fixture
def rig(tmp_path: Path) -> RigConfig:
    return load_rig(write_rig_file(tmp_path, robot="127.0.0.2", camera="127.0.0.3", generation="e-series"))


def readings(
    rotations: list[NDArray[np.float64]],
    mass_kg: float,
    centre_m: tuple[float, ...],
    offset_n: tuple[float, ...],
    offset_nm: tuple[float, ...],
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """What a perfect sensor says of a payload, told of another one."""
    tool_m = np.array([0, 0, TOLD.tcp_length_m])
    moment = mass_kg * (np.array(centre_m) - tool_m) - TOLD.payload_kg * (np.array(TOLD.centre_of_mass_m) - tool_m)
    forces = [turn @ offset_n + (mass_kg - TOLD.payload_kg) * GRAVITY_M_S2 for turn in rotations]
    torques = [turn @ offset_nm + np.cross(turn @ moment, GRAVITY_M_S2) for turn in rotations]
    return forces, torques


def rotations_of(rig: RigConfig) -> list[NDArray[np.float64]]:
    return [pose[:3, :3] for pose in weighing_poses(rig)]


def test_poses_are_such_as_the_arm_may_take(rig: RigConfig) -> None:
    poses = list(weighing_poses(rig))
    assert len(poses) == 7
    for pose in poses:
        check_pose(rig, 0.0, pose, most_tilt_rad=MOST_TILT_RAD)
    assert max(math.acos(-pose[2, 2]) for pose in poses) == pytest.approx(math.radians(20))


@given(mass_kg=st.floats(0.2, 8), centre_m=centres, offset_n=offsets, offset_nm=offsets)
def test_any_payload_is_told_from_any_offset_of_the_sensor(
    tmp_path_factory: pytest.TempPathFactory,
    mass_kg: float,
    centre_m: tuple[float, float, float],
    offset_n: tuple[float, float, float],
    offset_nm: tuple[float, float, float],
) -> None:
    folder = tmp_path_factory.mktemp("rig")
    path = write_rig_file(folder, robot="127.0.0.2", camera="127.0.0.3", generation="e-series")
    rotations = rotations_of(load_rig(path))
    found = solve_payload(TOLD, rotations, *readings(rotations, mass_kg, centre_m, offset_n, offset_nm))
    assert found.mass_kg == pytest.approx(mass_kg, abs=1e-6)
    assert found.centre_of_mass_m == pytest.approx(centre_m, abs=1e-6)
    assert found.residual_n < 1e-6
    assert found.residual_nm < 1e-6
    assert (found.told_kg, found.poses) == (1.3, 7)


def test_what_pulls_at_the_tool_in_one_pose_alone_is_no_weight(rig: RigConfig) -> None:
    rotations = rotations_of(rig)
    forces, torques = readings(rotations, 1.5, (0.0, 0.0, 0.06), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    forces[2] = forces[2] + np.array([20.0, 0.0, 0.0])
    with pytest.raises(RigSettingsError, match=r"3\.8 N and .* off any weight"):
        solve_payload(TOLD, rotations, forces, torques)


def test_no_weight_is_refused(rig: RigConfig) -> None:
    rotations = rotations_of(rig)
    forces, torques = readings(rotations, -0.5, (0.0, 0.0, 0.06), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    with pytest.raises(RigSettingsError, match=r"would weigh -0\.50 kg"):
        solve_payload(TOLD, rotations, forces, torques)


def test_an_arm_without_a_sensor_moves_nowhere(rig: RigConfig) -> None:
    arm = Arm(replace(rig, robot=replace(rig.robot, generation="cb3")), table_height_m=0.0)
    with pytest.raises(RigSettingsError, match="a cb3 has no force sensor to weigh with"):
        calibrate_payload(arm)
    assert not arm.child.alive
