from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from handsight.servoing.planar import PlanarPose, PlanarStep

metres = st.floats(-2, 2)
angles = st.floats(-3, 3)
poses = st.builds(PlanarPose, x_m=metres, y_m=metres, angle_rad=angles)
steps = st.builds(PlanarStep, dx_m=metres, dy_m=metres, dangle_rad=angles)


def _step_matrix(step: PlanarStep) -> NDArray[np.float64]:
    cos, sin = math.cos(step.dangle_rad), math.sin(step.dangle_rad)
    return np.array([[cos, -sin, 0, step.dx_m], [sin, cos, 0, step.dy_m], [0, 0, 1, 0], [0, 0, 0, 1]])


@given(pose=poses, step=steps)
def test_after_is_the_product_of_tool_poses(pose: PlanarPose, step: PlanarStep) -> None:
    """A step is taken in the tool frame: pose_base_tool' = pose_base_tool @ pose_tool_tool'."""
    product = pose.pose_base_tool(0.4) @ _step_matrix(step)
    np.testing.assert_allclose(pose.after(step).pose_base_tool(0.4), product, atol=1e-12)


@given(pose=poses, step=steps)
def test_step_to_inverts_after(pose: PlanarPose, step: PlanarStep) -> None:
    found = pose.step_to(pose.after(step))
    assert (found.dx_m, found.dy_m) == pytest.approx((step.dx_m, step.dy_m), abs=1e-9)
    assert math.remainder(found.dangle_rad - step.dangle_rad, 2 * math.pi) == pytest.approx(0, abs=1e-9)


@given(pose=poses)
def test_pose_base_tool_is_a_rigid_motion_that_points_down(pose: PlanarPose) -> None:
    matrix = pose.pose_base_tool(0.3)
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)
    assert matrix[:3, 2].tolist() == [0, 0, -1]
    back = PlanarPose.from_pose_base_tool(matrix)
    assert (back.x_m, back.y_m) == (pose.x_m, pose.y_m)
    assert math.remainder(back.angle_rad - pose.angle_rad, 2 * math.pi) == pytest.approx(0, abs=1e-12)
