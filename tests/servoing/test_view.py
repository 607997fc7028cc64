"""The warped picture is what the camera sees after the move: signs, frames and offsets against PyBullet's renderer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from tests.support.alignment import FULL, INNER, SKEWED, look, shift_px, write_textured_square

from handsight.collection.sim.bullet import BulletClient, connect
from handsight.collection.sim.bullet import pybullet as pb
from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.servoing.camera import HandCamera
from handsight.servoing.homography import InputGrid, predict_inputs
from handsight.servoing.planar import PlanarPose, PlanarStep
from handsight.servoing.prepared_view import PreparedView
from handsight.servoing.view import View


@pytest.fixture(scope="module")
def textured_plane(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BulletClient]:
    """A PyBullet world that holds nothing but a plane at z = 0 with a smooth random texture."""
    engine = connect()
    square = write_textured_square(tmp_path_factory.mktemp("plane"))
    engine.createMultiBody(0, -1, engine.createVisualShape(pb.GEOM_MESH, fileName=str(square)), (0.6, 0.0, 0.0))
    yield engine
    engine.disconnect()


def _gray(inputs: torch.Tensor) -> NDArray[np.float32]:
    gray: NDArray[np.float32] = inputs[0, :3].mean(0).numpy()
    return gray


NO_STEP = torch.zeros(1, 3)


@pytest.mark.parametrize("camera", [D435_ON_GRIPPER, SKEWED], ids=["d435", "skewed"])
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    dx_m=st.floats(-0.04, 0.04),
    dy_m=st.floats(-0.04, 0.04),
    dangle_rad=st.floats(-0.5, 0.5),
    angle_rad=st.floats(-1.5, 1.5),
)
def test_prediction_matches_the_view_after_the_move(
    textured_plane: BulletClient, camera: HandCamera, dx_m: float, dy_m: float, dangle_rad: float, angle_rad: float
) -> None:
    before = PlanarPose(x_m=0.62, y_m=0.01, angle_rad=angle_rad)
    after = before.after(PlanarStep(dx_m=dx_m, dy_m=dy_m, dangle_rad=dangle_rad))
    predicted = predict_inputs(
        look(textured_plane, camera, before), torch.tensor([[dx_m, dy_m, dangle_rad]]), grid=FULL
    )
    seen = predict_inputs(look(textured_plane, camera, after), NO_STEP, grid=FULL)
    a, b = _gray(predicted)[INNER, INNER], _gray(seen)[INNER, INNER]
    assert shift_px(a, b) < 0.05
    assert np.abs(a - b).mean() < 0.01


def test_prediction_across_heights(textured_plane: BulletClient) -> None:
    """An overhead picture predicts the pre-grasp view: the same affine map with another scale."""
    overhead, pregrasp = PlanarPose(x_m=0.6, y_m=0, angle_rad=0), PlanarPose(x_m=0.63, y_m=0.02, angle_rad=0.7)
    step = overhead.step_to(pregrasp)
    far = look(textured_plane, SKEWED, overhead, height_m=0.5)
    near = look(textured_plane, SKEWED, pregrasp)
    steps = torch.tensor([[step.dx_m, step.dy_m, step.dangle_rad]])
    predicted = predict_inputs(far, steps, grid=FULL, view_plane_m=far.plane_m - 0.1)
    a, b = _gray(predicted)[75:225, 75:225], _gray(predict_inputs(near, NO_STEP, grid=FULL))[75:225, 75:225]
    assert shift_px(a, b) < 0.05


def test_the_middle_of_the_input_is_the_grasp_point(textured_plane: BulletClient) -> None:
    """A small ball on the table under the fingertips appears in the centre of the network's input."""
    pose = PlanarPose(x_m=0.6, y_m=0.05, angle_rad=0.4)
    shape = textured_plane.createVisualShape(pb.GEOM_SPHERE, radius=0.006, rgbaColor=(1, 0, 0, 1))
    ball = textured_plane.createMultiBody(0, -1, shape, (pose.x_m, pose.y_m, 0.0))
    try:
        view = look(textured_plane, SKEWED, pose)
    finally:
        textured_plane.removeBody(ball)
    height_m = -predict_inputs(view, NO_STEP, grid=FULL)[0, 3].numpy()
    rows, columns = np.nonzero(height_m > 0.002)
    middle = 0.5 * (FULL.size_px - 1)
    assert abs(columns.mean() - middle) < 0.5
    assert abs(rows.mean() - middle) < 0.5


def test_downsampling_does_not_alias() -> None:
    """Stripes finer than the network's grid come out as their mean instead of a coarser pattern."""
    k = D435_ON_GRIPPER.intrinsics
    rgb = np.zeros((k.height, k.width, 3), np.uint8)
    rgb[:, ::4], rgb[:, 1::4] = 255, 255
    view = View(rgb=rgb, depth_m=np.full((k.height, k.width), 0.5, np.float32), camera=D435_ON_GRIPPER)
    grid = InputGrid()
    prepared = PreparedView.from_view(view, pixels_per_cell=grid.pixels_per_cell)
    turned = torch.tensor([[0.0, 0.0, angle] for angle in np.linspace(-1.5, 1.5, 7)], dtype=torch.float32)
    inputs = predict_inputs(prepared, turned, grid=grid)
    assert (inputs[:, :3, 16:48, 16:48] - 0.5).abs().max() < 0.1


def test_edges_are_replicated() -> None:
    k = D435_ON_GRIPPER.intrinsics
    rgb = np.full((k.height, k.width, 3), 10, np.uint8)
    rgb[:, -30:] = 200
    view = View(rgb=rgb, depth_m=np.full((k.height, k.width), 0.5, np.float32), camera=D435_ON_GRIPPER)
    prepared = PreparedView.from_view(view, pixels_per_cell=1)
    far_right = predict_inputs(prepared, torch.tensor([[0.3, 0.0, 0.0]]), grid=InputGrid())
    torch.testing.assert_close(far_right[0, :3, :, 40:], torch.full((3, 64, 24), 200 / 255))


def test_invalid_depth_is_filled_from_its_neighbours() -> None:
    k = D435_ON_GRIPPER.intrinsics
    depth_m = np.full((k.height, k.width), 0.5, np.float32)
    depth_m[200:210, 300:330] = 0.0
    depth_m[300:302, 300:302] = np.nan
    view = View(rgb=np.zeros((k.height, k.width, 3), np.uint8), depth_m=depth_m, camera=D435_ON_GRIPPER)
    assert view.plane_m == pytest.approx(0.5)
    prepared = PreparedView.from_view(view, pixels_per_cell=3)
    torch.testing.assert_close(prepared.channels[3], torch.zeros_like(prepared.channels[3]), atol=1e-6, rtol=0)
