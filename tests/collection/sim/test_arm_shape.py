"""The arm's shape stands as Bullet's arm does."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handsight.collection.sim.arm import Arm
from handsight.collection.sim.arm_model import temporary_arm_urdf
from handsight.collection.sim.arm_shape import Ur10Shape
from handsight.collection.sim.bullet import connect
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.grippers import DEFAULT_GRIPPER, gripper_named
from handsight.servoing.planar import PlanarPose


@pytest.fixture(scope="module")
def shape() -> Ur10Shape:
    return Ur10Shape()


@pytest.mark.parametrize(("x_m", "y_m", "angle_rad", "height_m"), [(0.6, 0.1, 0.3, 0.4), (0.8, -0.3, -1.2, 0.05)])
def test_links_stand_where_bullet_puts_them(
    shape: Ur10Shape, x_m: float, y_m: float, angle_rad: float, height_m: float
) -> None:
    goal = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad).pose_base_tool(height_m)
    poses = shape.poses_base_link(goal)
    assert poses is not None
    folder, urdf = temporary_arm_urdf(gripper_named(DEFAULT_GRIPPER))
    bullet = connect()
    try:
        arm = Arm(bullet, urdf, SimConfig())
        arm.place(goal)
        links = {
            bullet.getJointInfo(arm.body, joint)[12].decode(): joint for joint in range(bullet.getNumJoints(arm.body))
        }
        for link, pose in zip(shape.links[1:], poses[1:], strict=True):
            # The frame of a link, not of its centre of mass.
            position_m, quaternion = bullet.getLinkState(arm.body, links[link.name], computeForwardKinematics=True)[4:6]
            np.testing.assert_allclose(pose[:3, 3], position_m, atol=1e-5)
            np.testing.assert_allclose(pose[:3, :3], Rotation.from_quat(quaternion).as_matrix(), atol=1e-4)
    finally:
        bullet.disconnect()
        folder.cleanup()


def test_where_the_arm_cannot_stand_there_is_no_drawing(shape: Ur10Shape) -> None:
    assert shape.poses_base_link(PlanarPose(x_m=3.0, y_m=0.0, angle_rad=0.0).pose_base_tool(0.4)) is None


def test_the_shape_is_small_and_whole(shape: Ur10Shape) -> None:
    assert shape.links[0].name == "base_link"
    assert len(shape.links) == 7
    size = 0
    for link in shape.links:
        assert link.triangles.max() < len(link.vertices_m) == len(link.normals)
        np.testing.assert_allclose(np.linalg.norm(link.normals, axis=1), 1, atol=1e-3)
        size += link.vertices_m.nbytes + link.normals.nbytes + link.triangles.nbytes
    assert size < 300_000
