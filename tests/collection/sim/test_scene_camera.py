"""The outside picture: everything stands in it where the record says, and taking it changes no attempt."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.errors import StationSettingsError, UnreachableError
from handsight.collection.policy import UniformPolicy
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.grippers import FLANGE_TO_TIP_M
from handsight.collection.sim.scene_camera import LAMP_M, SceneCamera, Viewpoint, pose_looking_at
from handsight.collection.sim.static_replica import StaticReplica
from handsight.collection.sim.station import SimStation
from handsight.collection.sim.table import TABLE_CENTRE_M, TABLE_HALF_SIZE_M, wooden_table
from handsight.datasets.records import SceneObjects
from handsight.servoing.camera import Intrinsics
from handsight.servoing.planar import PlanarPose

CONFIG = SimConfig()
VIEW = Viewpoint(width=320, height=240)
TOOL = PlanarPose(x_m=0.6, y_m=-0.05, angle_rad=0.4).pose_base_tool(0.4)
STROKE_M = CONFIG.gripper_stroke_m


def scene_of(*objects: tuple[int, float, float]) -> SceneObjects:
    """Upright objects: index in the catalogue and place on the table."""
    poses = [[x_m, y_m, 0.04, 0.0, 0.0, 0.0, 1.0] for _, x_m, y_m in objects]
    return SceneObjects(
        catalogue_index=np.array([index for index, *_ in objects], np.int16),
        pose_base_object=np.array(poses).reshape(-1, 7),
        target=0,
    )


def pixel_of(point_m: tuple[float, float, float]) -> tuple[int, int]:
    """Row and column at which the camera sees a point of the base frame."""
    k = Intrinsics.from_vertical_fov(width=VIEW.width, height=VIEW.height, fov_y_rad=VIEW.fov_y_rad)
    x, y, z, _ = np.linalg.inv(VIEW.pose_base_camera) @ (*point_m, 1.0)
    return round(k.fy * y / z + k.cy), round(k.fx * x / z + k.cx)


def changed(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.asarray(np.abs(a.astype(int) - b).max(axis=2) > 12)


@pytest.fixture(scope="module")
def camera() -> Iterator[SceneCamera]:
    camera = SceneCamera(CONFIG, wooden_table(np.random.default_rng(0)), VIEW)
    yield camera
    camera.close()


@pytest.fixture(scope="module")
def empty(camera: SceneCamera) -> NDArray[np.uint8]:
    """The arm over a bare table."""
    return camera.picture(TOOL, STROKE_M, scene_of())


def test_the_picture_has_the_size_asked_for(empty: NDArray[np.uint8]) -> None:
    assert empty.shape == (240, 320, 3)
    assert empty.dtype == np.uint8


@pytest.mark.parametrize(("x_m", "y_m"), [(0.55, 0.1), (0.75, 0.12), (0.78, -0.14)])
def test_an_object_is_seen_where_it_lies_and_nowhere_else(
    camera: SceneCamera, empty: NDArray[np.uint8], x_m: float, y_m: float
) -> None:
    difference = changed(camera.picture(TOOL, STROKE_M, scene_of((0, x_m, y_m))), empty)
    row, column = pixel_of((x_m, y_m, 0.04))
    assert difference[row - 2 : row + 3, column - 2 : column + 3].all()
    rows, columns = np.nonzero(difference)
    assert np.hypot(rows - row, columns - column).max() < 40  # the object and its shadow


def test_objects_of_the_scene_before_are_gone(camera: SceneCamera, empty: NDArray[np.uint8]) -> None:
    camera.picture(TOOL, STROKE_M, scene_of((3, 0.6, 0.0), (5, 0.7, 0.1)))
    np.testing.assert_array_equal(camera.picture(TOOL, STROKE_M, scene_of()), empty)


def test_the_gripper_shades_the_table_where_it_stands_in_the_light(
    camera: SceneCamera, empty: NDArray[np.uint8]
) -> None:
    palm_m, lamp_m = (TOOL @ (0.0, 0.0, -0.11, 1.0))[:3], np.array(LAMP_M)
    shaded_m = lamp_m + (palm_m - lamp_m) * lamp_m[2] / (lamp_m[2] - palm_m[2])
    aside = TOOL.copy()
    aside[:2, 3] += 0.1, 0.25
    elsewhere = camera.picture(aside, STROKE_M, scene_of())
    row, column = pixel_of((shaded_m[0], shaded_m[1], 0.0))
    assert empty[row, column].mean() < 0.8 * elsewhere[row, column].mean()
    row, column = pixel_of((0.5, 0.45, 0.0))
    np.testing.assert_array_equal(empty[row, column], elsewhere[row, column])


def test_the_gripper_is_where_the_tool_pose_says(camera: SceneCamera, empty: NDArray[np.uint8]) -> None:
    palm = (TOOL @ (0.0, 0.0, -0.11, 1.0))[:3]
    row, column = pixel_of((palm[0], palm[1], palm[2]))
    assert empty[row, column].max() < 80  # the dark palm
    lower = TOOL.copy()
    lower[2, 3] -= 0.2
    assert camera.picture(lower, STROKE_M, scene_of())[row, column].max() > 80


def test_the_jaws_open_as_far_as_they_are_told(camera: SceneCamera, empty: NDArray[np.uint8]) -> None:
    difference = changed(camera.picture(TOOL, 0.01, scene_of()), empty)
    tip = (TOOL @ (0.5 * STROKE_M, 0.0, -0.03, 1.0))[:3]
    row, column = pixel_of((tip[0], tip[1], tip[2]))
    assert difference[row - 3 : row + 4, column - 3 : column + 4].any()


def test_beside_the_table_there_is_background(empty: NDArray[np.uint8]) -> None:
    corner_x_m, corner_y_m = TABLE_CENTRE_M[0] - TABLE_HALF_SIZE_M, TABLE_CENTRE_M[1] - TABLE_HALF_SIZE_M
    inside, outside = pixel_of((corner_x_m + 0.08, corner_y_m + 0.08, 0.0)), pixel_of((corner_x_m, corner_y_m, 0.08))
    red, _, blue = empty[inside].astype(int)
    assert red > blue + 30  # wood
    red, _, blue = empty[outside].astype(int)
    assert blue >= red  # sky


def test_the_copy_stands_as_the_station_does() -> None:
    replica = StaticReplica(CONFIG)
    scene = scene_of((2, 0.6, 0.1), (7, 0.7, -0.1))
    replica.arrange(TOOL, 0.05, scene)
    bullet, arm = replica.bullet, 0
    names = {bullet.getJointInfo(arm, joint)[1].decode(): joint for joint in range(bullet.getNumJoints(arm))}
    flange = bullet.getLinkState(arm, names["gripper_mount"], computeForwardKinematics=True)
    np.testing.assert_allclose(np.asarray(flange[4]) + FLANGE_TO_TIP_M * TOOL[:3, 2], TOOL[:3, 3], atol=1e-5)
    np.testing.assert_allclose(np.reshape(bullet.getMatrixFromQuaternion(flange[5]), (3, 3)), TOOL[:3, :3], atol=1e-5)
    assert sum(bullet.getJointState(arm, names[f"gripper_{side}_joint"])[0] for side in ("left", "right")) == 0.05
    bodies = [bullet.getBodyUniqueId(number) for number in range(bullet.getNumBodies())]
    poses = [(*position, *turn) for position, turn in map(bullet.getBasePositionAndOrientation, bodies[-2:])]
    np.testing.assert_allclose(poses, scene.pose_base_object)
    replica.close()


def test_pictures_from_outside_change_nothing_of_an_attempt(camera: SceneCamera) -> None:
    class WatchedStation(SimStation):
        def reach(self, pose: PlanarPose) -> None:
            super().reach(pose)
            camera.picture(pose.pose_base_tool(0.4), self.width_m, scene_of((0, 0.6, 0.1)))

    attempts = []
    for kind in (SimStation, WatchedStation):
        station = kind(CONFIG)
        attempts.append(run_attempt(station, UniformPolicy(), 2, attempt_seed(4, 2), pregrasp_picture=True))
        station.close()
    plain, watched = attempts
    assert plain.pregrasp is not None
    assert watched.pregrasp is not None
    np.testing.assert_array_equal(watched.pregrasp.rgb, plain.pregrasp.rgb)
    np.testing.assert_array_equal(watched.pose_base_tool_grasp, plain.pose_base_tool_grasp)
    assert watched.gripper == plain.gripper


def test_a_pose_out_of_reach_is_refused(camera: SceneCamera) -> None:
    with pytest.raises(UnreachableError, match="cannot put its fingertips"):
        camera.picture(PlanarPose(x_m=1.8, y_m=0.0, angle_rad=0.0).pose_base_tool(0.4), STROKE_M, scene_of())


coordinate_m = st.floats(-3, 3)


@given(
    eye_m=st.tuples(coordinate_m, coordinate_m, coordinate_m),
    target_m=st.tuples(coordinate_m, coordinate_m, coordinate_m),
)
def test_a_camera_looks_at_its_target_and_stands_upright(
    eye_m: tuple[float, float, float], target_m: tuple[float, float, float]
) -> None:
    if math.dist(eye_m[:2], target_m[:2]) < 1e-3:
        return
    pose = pose_looking_at(eye_m, target_m)
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-9)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    x, y, z, _ = np.linalg.inv(pose) @ (*target_m, 1.0)
    np.testing.assert_allclose((x, y, z), (0.0, 0.0, math.dist(eye_m, target_m)), atol=1e-9)
    assert pose[2, 0] == pytest.approx(0.0, abs=1e-12)  # the horizon is level
    assert pose[2, 1] < 0  # rows run downwards


def test_faults_of_a_viewpoint_are_reported_together() -> None:
    with pytest.raises(StationSettingsError, match=r"straight above.*not above the table.*field of view.*0x240"):
        Viewpoint(eye_m=(0.4, 0.0, -1.0), target_m=(0.4, 0.0, 0.3), fov_y_rad=4.0, width=0, height=240)
