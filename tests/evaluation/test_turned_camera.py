"""A turned camera sees what a pinhole camera with that rotation sees."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handsight.collection.sim.bullet import connect
from handsight.collection.sim.camera import render
from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.table import wooden_table
from handsight.datasets.records import RgbdFrame
from handsight.evaluation.turned_camera import random_turn, turned_frame
from handsight.servoing.camera import Intrinsics
from handsight.servoing.planar import PlanarPose

CAMERA = Intrinsics(width=160, height=120, fx=150.0, fy=140.0, cx=80.5, cy=58.0)
SQUARE = Intrinsics.from_vertical_fov(width=64, height=64, fov_y_rad=0.7)
MATRIX = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]])
DEPTH = 4000
AXES = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: math.hypot(*axis) > 0.1)
TURNS = st.builds(
    lambda axis, degrees: Rotation.from_rotvec(math.radians(degrees) * np.array(axis) / math.hypot(*axis)).as_matrix(),
    AXES,
    st.floats(0, 12),
)


def frame(rgb: NDArray[np.uint8], depth: NDArray[np.uint16]) -> RgbdFrame:
    return RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=np.eye(4))


def noise(camera: Intrinsics = CAMERA) -> RgbdFrame:
    rng = np.random.default_rng(0)
    shape = camera.height, camera.width
    return frame(rng.integers(0, 256, (*shape, 3), np.uint8), rng.integers(0, 60000, shape, np.uint16))


def seen_at(camera: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where a pinhole camera whose axes are the rows sees a point. Shape (2,), pixels."""
    homogeneous = MATRIX @ camera @ point
    seen: NDArray[np.float64] = homogeneous[:2] / homogeneous[2]
    return seen


def test_no_turn_leaves_the_frame_as_it_is() -> None:
    before = noise()
    after = turned_frame(before, CAMERA, np.eye(3))
    np.testing.assert_array_equal(after.rgb, before.rgb)
    np.testing.assert_array_equal(after.depth, before.depth)
    np.testing.assert_array_equal(after.pose_base_tool, before.pose_base_tool)


def test_a_quarter_turn_about_the_optical_axis_turns_the_picture() -> None:
    """Turned clockwise about its view, the camera sees everything turned the other way."""
    quarter = Rotation.from_euler("z", -90, degrees=True).as_matrix()
    before = noise(SQUARE)
    after = turned_frame(before, SQUARE, quarter)
    np.testing.assert_array_equal(after.depth, np.rot90(before.depth))
    np.testing.assert_allclose(after.rgb.astype(int), np.rot90(before.rgb).astype(int), atol=3)


@settings(max_examples=60, deadline=None)
@given(turn=TURNS, column=st.integers(60, 100), row=st.integers(45, 75))
def test_a_point_lands_where_a_pinhole_camera_puts_it(turn: NDArray[np.float64], column: int, row: int) -> None:
    rgb = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    depth = np.full(rgb.shape[:2], DEPTH, np.uint16)
    rgb[row - 2 : row + 3, column - 2 : column + 3] = 200
    point = DEPTH * np.linalg.inv(MATRIX) @ (column, row, 1)
    after = turned_frame(frame(rgb, depth), CAMERA, turn)
    expected = seen_at(turn, point)
    rows, columns = np.nonzero(after.rgb[..., 0] > 100)
    np.testing.assert_allclose((columns.mean(), rows.mean()), expected, atol=0.6)
    at_column, at_row = np.rint(expected).astype(int)
    assert after.depth[at_row, at_column] == pytest.approx((turn @ point)[2], abs=0.01 * DEPTH)


@settings(max_examples=60, deadline=None)
@given(turn=TURNS)
def test_a_plane_is_as_far_as_its_geometry_says(turn: NDArray[np.float64]) -> None:
    """Z = DEPTH in the axes of the camera as it was is a tilted plane for the turned one: n . X = DEPTH, n = R z."""
    flat = np.full((CAMERA.height, CAMERA.width), DEPTH, np.uint16)
    after = turned_frame(frame(np.zeros((*flat.shape, 3), np.uint8), flat), CAMERA, turn).depth
    row, column = np.nonzero(after)
    assert len(row) > 0.4 * after.size
    rays = np.stack([column, row, np.ones_like(row)], axis=-1) @ np.linalg.inv(MATRIX).T
    np.testing.assert_allclose(after[row, column], DEPTH / (rays @ turn[:, 2]), atol=0.51)


def test_what_was_outside_the_frame_has_no_depth() -> None:
    # Turned to the right by ten degrees, about 26 columns of the 160 are new, on the right.
    right = Rotation.from_euler("y", -10, degrees=True).as_matrix()
    flat = np.full((CAMERA.height, CAMERA.width), DEPTH, np.uint16)
    rgb = np.full((*flat.shape, 3), 77, np.uint8)
    after = turned_frame(frame(rgb, flat), CAMERA, right)
    assert after.depth[60, :125].all()
    assert not after.depth[60, 140:].any()
    assert (after.rgb == 77).all(), "the colour of the edge is carried on"


def test_what_had_no_depth_has_none() -> None:
    before = noise()
    before.depth[40:80] = 0
    after = turned_frame(before, CAMERA, Rotation.from_euler("x", 3, degrees=True).as_matrix())
    assert not after.depth[55:65].any()
    assert after.depth[:30].any()


def test_what_comes_to_lie_behind_the_camera_is_not_shown() -> None:
    wide = Intrinsics(width=100, height=100, fx=20.0, fy=20.0, cx=49.5, cy=49.5)
    flat = np.full((100, 100), DEPTH, np.uint16)
    turn = Rotation.from_euler("x", 30, degrees=True).as_matrix()
    after = turned_frame(frame(np.zeros((100, 100, 3), np.uint8), flat), wide, turn).depth
    rays = np.stack([np.full(100, 0.0), (np.arange(100) - 49.5) / 20, np.ones(100)], axis=-1)
    behind = rays @ turn[:, 2] <= 0
    assert behind.any()
    assert not after[behind].any()
    assert after.any()


def test_a_depth_too_large_for_its_type_is_the_largest() -> None:
    far = np.full((CAMERA.height, CAMERA.width), 65000, np.uint16)
    after = turned_frame(
        frame(np.zeros((*far.shape, 3), np.uint8), far), CAMERA, Rotation.from_euler("x", 12, degrees=True).as_matrix()
    ).depth
    assert after.max() == 65535
    assert after[after > 0].min() > 50000


def test_it_is_what_the_simulator_draws_from_a_turned_camera() -> None:
    turn = Rotation.from_rotvec(np.radians([3.0, -2.0, 3.0])).as_matrix()
    pose_base_tool = PlanarPose(x_m=0.65, y_m=0.0, angle_rad=0.3).pose_base_tool(0.4)
    pose_camera_turned, pose_tool_camera = np.eye(4), D435_ON_GRIPPER.pose_base_camera(np.eye(4))
    pose_camera_turned[:3, :3] = turn.T
    turned_tool = pose_base_tool @ pose_tool_camera @ pose_camera_turned @ np.linalg.inv(pose_tool_camera)
    bullet, table = connect(), wooden_table(np.random.default_rng(0))
    for x_m, model in zip((0.6, 0.68, 0.74), load_object_set("blocks-test"), strict=False):
        bullet.loadURDF(str(model.urdf), (x_m, 0.0, 0.03), globalScaling=model.scale)
    (rgb, depth), (drawn_rgb, drawn_depth) = (
        render(bullet, table, D435_ON_GRIPPER, pose, depth_scale_m=0.001) for pose in (pose_base_tool, turned_tool)
    )
    bullet.disconnect()
    after = turned_frame(
        RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=pose_base_tool), D435_ON_GRIPPER.intrinsics, turn
    )
    shown = after.depth > 0
    assert shown.mean() > 0.85
    wrong_mm = np.abs(after.depth.astype(int) - drawn_depth)[shown]
    unlike = np.abs(after.rgb.astype(int) - drawn_rgb).max(axis=2)[shown]
    # All but the pixels along edges, of which the untouched frame would be wrong almost everywhere.
    assert np.mean(wrong_mm > 1) < 0.01
    assert np.mean(unlike > 8) < 0.01
    assert np.mean(np.abs(depth.astype(int) - drawn_depth)[shown] > 1) > 0.5


def test_turns_have_their_angle_and_every_axis() -> None:
    rng = np.random.default_rng(3)
    turns = Rotation.from_matrix([random_turn(0.05, rng) for _ in range(400)]).as_rotvec()
    np.testing.assert_allclose(np.linalg.norm(turns, axis=1), 0.05)
    axes = turns / 0.05
    # Uniform over directions: no mean, and a third of the square along every axis.
    np.testing.assert_allclose(axes.mean(axis=0), 0, atol=0.1)
    np.testing.assert_allclose((axes**2).mean(axis=0), 1 / 3, atol=0.06)
