"""One pose, written in every convention, is one transform."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handsight.datasets.exchange.mapped.poses import pose_of, tilt_rad, transform_of
from handsight.servoing.planar import PlanarPose

UNITS = st.floats(-3, 3)


@given(st.tuples(UNITS, UNITS, UNITS), st.tuples(UNITS, UNITS, UNITS), st.sampled_from([1.0, 1e-3]))
def test_conventions_agree(translation_m: tuple[float, ...], rotvec: tuple[float, ...], unit_m: float) -> None:
    rotation = Rotation.from_rotvec(rotvec)
    expected = np.eye(4)
    expected[:3, :3], expected[:3, 3] = rotation.as_matrix(), translation_m
    there = np.array(translation_m) / unit_m
    matrix = expected.copy()
    matrix[:3, 3] = there
    written = {
        "xyz_rotvec": [*there, *rotvec],
        "xyz_quat_xyzw": [*there, *rotation.as_quat()],
        "xyz_quat_wxyz": [*there, *rotation.as_quat(scalar_first=True)],
        "matrix": matrix.ravel(),
    }
    for convention, numbers in written.items():
        found = pose_of(np.array(numbers, np.float64), convention, unit_m=unit_m, z_m=float("nan"))
        np.testing.assert_allclose(found, expected, atol=1e-9)


@given(UNITS, UNITS, UNITS)
def test_planar_poses_point_straight_down(x_m: float, y_m: float, angle_rad: float) -> None:
    pose = pose_of(np.array([x_m, y_m, angle_rad]), "x_y_angle", unit_m=1.0, z_m=0.02)
    assert tilt_rad(pose) == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(pose, PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad).pose_base_tool(0.02))


@pytest.mark.parametrize(
    ("numbers", "convention"),
    [
        ([0, 0, 0, 2, 0, 0, 0], "xyz_quat_xyzw"),
        ([0, 0, 0, 0, 0, 0, 0], "xyz_quat_wxyz"),
        ([0, 0, np.nan, 0, 0, 0], "xyz_rotvec"),
        ([*np.eye(4).ravel()[:-1], 2], "matrix"),
        (-np.eye(4).ravel(), "matrix"),
    ],
)
def test_what_is_no_pose_is_refused(numbers: list[float], convention: str) -> None:
    with pytest.raises(ValueError, match=r"quaternion|finite|rigid"):
        pose_of(np.array(numbers, np.float64), convention, unit_m=1.0, z_m=0.0)


@pytest.mark.parametrize("value", [None, "x", [1, 2], [[1, 2, 3]], [1, 2, float("nan")], [[0] * 4] * 4, {}, 10**400])
def test_what_is_no_transform_is_refused(value: object) -> None:
    with pytest.raises(ValueError, match=r"three numbers|rigid"):
        transform_of(value)
