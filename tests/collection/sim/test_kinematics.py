"""Closed-form inverse kinematics against PyBullet's forward kinematics of the shipped URDF."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handsight.collection.errors import UnreachableError
from handsight.collection.sim.arm import Arm
from handsight.collection.sim.arm_model import temporary_arm_urdf
from handsight.collection.sim.bullet import connect
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.grippers import DEFAULT_GRIPPER, gripper_named
from handsight.collection.sim.kinematics import JOINT_LIMITS_RAD, REFERENCE_RAD, joints_for
from handsight.servoing.planar import PlanarPose


@pytest.fixture(scope="module")
def arm() -> Iterator[Arm]:
    folder, urdf = temporary_arm_urdf(gripper_named(DEFAULT_GRIPPER))
    bullet = connect()
    yield Arm(bullet, urdf, SimConfig())
    bullet.disconnect()
    folder.cleanup()


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    x_m=st.floats(0.35, 0.95), y_m=st.floats(-0.35, 0.35), angle_rad=st.floats(-1.57, 1.57), height_m=st.floats(0, 0.5)
)
def test_fingertips_arrive_where_they_were_sent(
    arm: Arm, x_m: float, y_m: float, angle_rad: float, height_m: float
) -> None:
    goal = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad).pose_base_tool(height_m)
    arm.place(goal)
    np.testing.assert_allclose(arm.hand.pose_base_tool, goal, atol=1e-6)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    x_m=st.floats(0.2, 1.5),
    y_m=st.floats(-0.8, 0.8),
    height_m=st.floats(-0.2, 0.9),
    angle_rad=st.floats(-np.pi, np.pi),
    roll_rad=st.floats(-1, 1),
    pitch_rad=st.floats(-1, 1),
)
def test_what_is_not_refused_is_reached(
    arm: Arm, x_m: float, y_m: float, height_m: float, angle_rad: float, roll_rad: float, pitch_rad: float
) -> None:
    """The solver answers for poses out of reach too, with joints that come as close as they can."""
    goal = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad).pose_base_tool(height_m)
    goal[:3, :3] @= Rotation.from_euler("xy", (roll_rad, pitch_rad)).as_matrix()
    try:
        arm.place(goal)
    except UnreachableError:
        return
    np.testing.assert_allclose(arm.hand.pose_base_tool, goal, atol=1e-6)


@pytest.mark.parametrize("x_m", [0.53, 0.62, 0.75, 0.87, 0.89, 0.99])
def test_of_two_solutions_by_symmetry_the_arm_takes_that_of_its_branch(x_m: float) -> None:
    """Here shoulder and last wrist joint trade places, and turn equally far: the last bit must not decide."""
    joints_rad = joints_for(PlanarPose(x_m=x_m, y_m=0.0, angle_rad=0.5 * np.pi).pose_base_tool(0.13), REFERENCE_RAD)
    assert abs(joints_rad[0] - REFERENCE_RAD[0]) < 0.5


def test_the_arm_does_not_bend_over_its_shoulder() -> None:
    """It did at one of 15,000 random grasps, and pressed the upper arm into the table: the last wrist turned less."""
    overhead = joints_for(PlanarPose(x_m=0.65, y_m=0.0, angle_rad=0.0).pose_base_tool(0.5), REFERENCE_RAD)
    pose = PlanarPose(x_m=0.43905, y_m=0.26817, angle_rad=-1.54138).pose_base_tool(0.4)
    turned_rad = joints_for(pose, overhead)[0] - REFERENCE_RAD[0]
    assert abs(turned_rad - np.arctan2(0.26817, 0.43905)) < 0.6


@given(x_m=st.floats(0.45, 0.85), y_m=st.floats(-0.2, 0.2), dx_m=st.floats(-0.01, 0.01), dy_m=st.floats(-0.01, 0.01))
def test_neighbouring_poses_have_neighbouring_joints(x_m: float, y_m: float, dx_m: float, dy_m: float) -> None:
    """The arm stays on one branch: a centimetre never flips elbow or wrist."""
    here = joints_for(PlanarPose(x_m=x_m, y_m=y_m, angle_rad=0.3).pose_base_tool(0.2), REFERENCE_RAD)
    there = joints_for(PlanarPose(x_m=x_m + dx_m, y_m=y_m + dy_m, angle_rad=0.3).pose_base_tool(0.2), here)
    assert np.abs(there - here).max() < 0.2
    assert (np.abs(there) <= JOINT_LIMITS_RAD).all()


@pytest.mark.parametrize("x_m", [1.25, 3.0])
def test_out_of_reach_is_said_with_the_place(x_m: float) -> None:
    pose = PlanarPose(x_m=x_m, y_m=0.0, angle_rad=0.0).pose_base_tool(0.4)
    with pytest.raises(UnreachableError, match=rf"descend: .*{x_m:.3f}"):
        joints_for(pose, REFERENCE_RAD, phase="descend")
