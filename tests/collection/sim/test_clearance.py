"""The height at which the open hand would first touch something."""

from __future__ import annotations

import pytest

from handsight.collection.sim.bullet import BulletClient, pybullet
from handsight.collection.sim.clearance import first_touch_m
from handsight.collection.sim.grippers import GRIPPERS, Gripper
from handsight.collection.sim.table import add_table
from handsight.servoing.planar import PlanarPose

HEIGHT_M = 0.1
FINGERS_M = 0.065


@pytest.fixture(params=sorted(GRIPPERS))
def gripper(request: pytest.FixtureRequest) -> Gripper:
    return GRIPPERS[request.param]


def touch_m(bullet: BulletClient, gripper: Gripper, angle_rad: float, across_m: float, height_m: float) -> float:
    """With a column of that height that stands so far from the hand's middle along the way of the jaws."""
    add_table(bullet)
    pose = PlanarPose(x_m=0.6, y_m=0.0, angle_rad=angle_rad).pose_base_tool(0.4)
    x_m, y_m = (pose[:2, 3] + across_m * pose[:2, 0]).tolist()
    shape = bullet.createCollisionShape(pybullet.GEOM_CYLINDER, radius=0.004, height=height_m)
    bullet.createMultiBody(0, shape, -1, (x_m, y_m, 0.5 * height_m))
    bullet.stepSimulation()
    return first_touch_m(bullet, gripper, pose)


@pytest.mark.parametrize("angle_rad", [0.0, 0.7, -1.4])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_column_under_a_finger(bullet: BulletClient, gripper: Gripper, angle_rad: float, side: int) -> None:
    across_m = side * (0.5 * gripper.stroke_m + 0.005)
    assert touch_m(bullet, gripper, angle_rad, across_m, HEIGHT_M) == pytest.approx(HEIGHT_M, abs=1e-4)


def test_a_column_under_the_palm_comes_between_the_fingers_first(bullet: BulletClient, gripper: Gripper) -> None:
    assert touch_m(bullet, gripper, 0.7, 0.0, HEIGHT_M) == pytest.approx(HEIGHT_M - FINGERS_M, abs=1e-4)


def test_a_column_beside_the_hand_is_none_of_its_business(bullet: BulletClient, gripper: Gripper) -> None:
    across_m = 0.5 * gripper.palm_m[0] + 0.01
    assert touch_m(bullet, gripper, 0.7, across_m, HEIGHT_M) == pytest.approx(0.0, abs=1e-4)
