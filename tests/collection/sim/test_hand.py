"""The hand on the wrist: it yields to what pushes it, carries what it lifts, and feels contact from every side."""

from __future__ import annotations

import numpy as np
import pytest

from handsight.collection.sim.arm import Arm
from handsight.collection.sim.arm_model import temporary_arm_urdf
from handsight.collection.sim.bullet import BulletClient, pybullet
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.grippers import DEFAULT_GRIPPER, gripper_named
from handsight.servoing.planar import PlanarPose

HEIGHT_M = 0.1
POSE = PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.0).pose_base_tool(HEIGHT_M)


@pytest.fixture
def arm(bullet: BulletClient) -> Arm:
    """At rest above nothing."""
    bullet.setGravity(0, 0, -9.81)
    folder, urdf = temporary_arm_urdf(gripper_named(DEFAULT_GRIPPER))
    with folder:
        loaded = Arm(bullet, urdf, SimConfig())
    loaded.place(POSE)
    return loaded


def block(bullet: BulletClient, half_size_m: tuple[float, float, float], place_m: tuple[float, float, float]) -> int:
    shape = bullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half_size_m)
    body: int = bullet.createMultiBody(0, shape, -1, place_m)
    return body


def steps(bullet: BulletClient, count: int) -> None:
    for _ in range(count):
        bullet.stepSimulation()


def test_the_hand_hangs_at_the_end_of_its_travel(bullet: BulletClient, arm: Arm) -> None:
    steps(bullet, 100)
    assert arm.hand.retraction_m == pytest.approx(0.0, abs=1e-4)
    np.testing.assert_allclose(arm.hand.pose_base_tool, POSE, atol=1e-3)
    assert arm.hand.contact_force_n == 0


def test_an_obstacle_pushes_the_hand_back_and_feels_no_arm(bullet: BulletClient, arm: Arm) -> None:
    """Lowered 10 mm into a fixed block, the hand ends on it, with its weight and the slide's motor and no more."""
    block(bullet, (0.1, 0.1, 0.05), (0.6, 0.0, HEIGHT_M - 0.055))
    lower = POSE.copy()
    lower[2, 3] -= 0.015
    arm.move_line(lower, bullet.stepSimulation, phase="descend")
    steps(bullet, 100)
    assert arm.hand.retraction_m == pytest.approx(0.010, abs=1e-3)
    assert 15 < arm.hand.contact_force_n < 30
    assert arm.hand.pose_base_tool[2, 3] == pytest.approx(HEIGHT_M - 0.005, abs=1e-3)


def test_contact_from_the_side_is_felt(bullet: BulletClient, arm: Arm) -> None:
    """Both jaws close on a fixed block between them: no vertical force, and sideways ones that cancel."""
    body = block(bullet, (0.02, 0.05, 0.05), (0.6, 0.0, HEIGHT_M))
    assert not arm.hand.touches(body)
    arm.hand.drive_fingers(opening_m_s=-0.1)
    steps(bullet, 100)
    assert arm.hand.contact_force_n > 50
    assert arm.hand.touches(body)
    assert arm.hand.width_m == pytest.approx(0.04, abs=1e-3)


def test_one_finger_is_touch_enough(bullet: BulletClient, arm: Arm) -> None:
    body = block(bullet, (0.02, 0.02, 0.05), (0.6 + 0.0425 + 0.005, 0.0, HEIGHT_M - 0.048))
    steps(bullet, 20)
    assert arm.hand.contact_force_n > 0
    assert arm.hand.touches(body)


@pytest.mark.parametrize(
    ("part", "half_size_m", "place_m"),
    [
        ("finger", (0.02, 0.02, 0.05), (0.6 + 0.0425 + 0.005, 0.0, HEIGHT_M - 0.048)),
        ("palm", (0.01, 0.01, 0.06), (0.6, 0.0, HEIGHT_M + 0.007)),  # Between the fingers, 65 mm long.
    ],
)
def test_the_part_that_is_pressed_is_told(
    bullet: BulletClient,
    arm: Arm,
    part: str,
    half_size_m: tuple[float, float, float],
    place_m: tuple[float, float, float],
) -> None:
    steps(bullet, 5)
    assert arm.hand.pressed_part == ""
    block(bullet, half_size_m, place_m)
    steps(bullet, 5)
    assert arm.hand.pressed_part == part


def test_what_presses_on_the_forearm_presses_on_the_arm(bullet: BulletClient, arm: Arm) -> None:
    links = {bullet.getJointInfo(arm.body, joint)[12]: joint for joint in range(bullet.getNumJoints(arm.body))}
    middle_m = bullet.getLinkState(arm.body, links[b"forearm_link"])[0]
    block(bullet, (0.03, 0.03, 0.03), middle_m)
    steps(bullet, 5)
    assert arm.hand.pressed_part == "arm"
