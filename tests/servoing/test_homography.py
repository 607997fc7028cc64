"""Laws that the affine maps obey, and warped pictures against what PyBullet's camera sees after the move."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from tests.support.alignment import FULL, INNER, SKEWED, look, shift_px, write_textured_square
from tests.support.drawn_table import START, DrawnTable
from torch import Tensor

from handsight.collection.sim.bullet import BulletClient, connect
from handsight.collection.sim.bullet import pybullet as pb
from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.errors import CameraModelError, ServoSettingsError, StepError
from handsight.servoing.homography import SAME_SCALE, InputGrid, predict_inputs, raw_from_input
from handsight.servoing.planar import PlanarPose, PlanarStep
from handsight.servoing.prepared_view import PreparedView

cameras = st.builds(
    HandCamera,
    intrinsics=st.builds(
        lambda focal, cx, cy: Intrinsics(width=640, height=480, fx=focal, fy=focal, cx=cx, cy=cy),
        st.floats(300, 900),
        st.floats(250, 390),
        st.floats(180, 300),
    ),
    x_tool_camera_m=st.floats(-0.1, 0.1),
    y_tool_camera_m=st.floats(-0.1, 0.1),
    z_tool_camera_m=st.just(-0.1),
)
small_steps = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-1.5, 1.5))
GRID = InputGrid()


def _maps(camera: HandCamera, *steps: tuple[float, float, float], view_plane_m: float = 0.5) -> Tensor:
    rows = torch.tensor(steps, dtype=torch.float64)
    return raw_from_input(camera, rows, plane_m=0.5, view_plane_m=view_plane_m, grid=GRID)


@given(camera=cameras)
def test_without_a_step_the_middle_maps_to_the_grasp_point(camera: HandCamera) -> None:
    k = camera.intrinsics
    middle = torch.tensor([31.5, 31.5, 1.0], dtype=torch.float64)
    raw = _maps(camera, (0, 0, 0))[0] @ middle
    # The fingertips are at the tool's origin; seen from the camera they lie at minus its offset.
    expected = (k.cx - k.fx * camera.x_tool_camera_m / 0.5, k.cy - k.fy * camera.y_tool_camera_m / 0.5)
    assert raw.tolist() == pytest.approx(expected)


@given(camera=cameras, step=small_steps)
def test_turning_keeps_lengths_and_orientation(camera: HandCamera, step: tuple[float, float, float]) -> None:
    linear = _maps(camera, step)[0, :, :2]
    scale = GRID.crop_px / GRID.size_px
    torch.testing.assert_close(linear @ linear.T, torch.eye(2, dtype=torch.float64) * scale**2)
    assert torch.linalg.det(linear) > 0


@given(camera=cameras, first=small_steps, second=small_steps)
def test_steps_compose(
    camera: HandCamera, first: tuple[float, float, float], second: tuple[float, float, float]
) -> None:
    """Two steps after each other predict what their product predicts (a group action of SE(2))."""
    cos, sin = torch.cos(torch.tensor(first[2])), torch.sin(torch.tensor(first[2]))
    both = (
        first[0] + float(cos) * second[0] - float(sin) * second[1],
        first[1] + float(sin) * second[0] + float(cos) * second[1],
        first[2] + second[2],
    )
    zero, one, two, product = (_square(m) for m in _maps(camera, (0, 0, 0), first, second, both))
    torch.testing.assert_close(one @ torch.linalg.inv(zero) @ two, product, rtol=1e-6, atol=1e-4)


@given(camera=cameras, view_plane_m=st.floats(0.3, 0.8))
def test_another_height_only_scales(camera: HandCamera, view_plane_m: float) -> None:
    here, there = _maps(camera, (0, 0, 0))[0], _maps(camera, (0, 0, 0), view_plane_m=view_plane_m)[0]
    torch.testing.assert_close(there[:, :2], here[:, :2] * (view_plane_m / 0.5))


@given(
    camera=cameras,
    step=small_steps,
    plane_m=st.floats(0.25, 0.8),
    view_plane_m=st.floats(0.25, 0.8),
    span_m=st.floats(0.1, 0.6),
)
def test_a_network_sees_as_much_of_the_table_from_any_height_and_by_any_camera(
    camera: HandCamera, step: tuple[float, float, float], plane_m: float, view_plane_m: float, span_m: float
) -> None:
    grid = InputGrid(span_m=span_m)
    rows = torch.tensor([step], dtype=torch.float64)
    linear = raw_from_input(camera, rows, plane_m=plane_m, view_plane_m=view_plane_m, grid=grid)[0, :, :2]
    side_px = float(torch.linalg.norm(linear[:, 0])) * grid.size_px
    side_m = side_px * plane_m / camera.intrinsics.fx
    # What is measured of the table's distance differs by millimetres from picture to picture, and stays as it is.
    as_it_is_m = grid.crop_px * view_plane_m / camera.intrinsics.fx
    expected_m = as_it_is_m if abs(span_m / as_it_is_m - 1) < SAME_SCALE else span_m
    assert side_m == pytest.approx(expected_m)


@pytest.mark.parametrize("span_m", [0.0, -0.3, float("nan"), float("inf")])
def test_impossible_spans_are_refused(span_m: float) -> None:
    with pytest.raises(ServoSettingsError, match="expected a positive length"):
        InputGrid(span_m=span_m)


def test_a_grid_is_told_without_a_span_that_nobody_knows() -> None:
    assert InputGrid().to_json() == {"crop_px": 400, "size_px": 64}
    spanned = InputGrid(span_m=0.32)
    assert InputGrid(**spanned.to_json()) == spanned


def _square(affine: Tensor) -> Tensor:
    return torch.cat([affine, torch.tensor([[0.0, 0.0, 1.0]], dtype=affine.dtype)])


@pytest.mark.parametrize(("crop_px", "size_px"), [(400, 1), (32, 64)])
def test_impossible_grids_are_refused(crop_px: int, size_px: int) -> None:
    with pytest.raises(ServoSettingsError, match="1 < size <= crop"):
        InputGrid(crop_px=crop_px, size_px=size_px)


def test_impossible_intrinsics_report_every_fault() -> None:
    with pytest.raises(CameraModelError) as caught:
        Intrinsics(width=0, height=480, fx=-1.0, fy=600.0, cx=float("nan"), cy=0.0)
    for part in ("0x480", "(-1.0, 600.0)", "principal point"):
        assert part in str(caught.value)


@pytest.fixture(scope="module")
def textured_plane(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BulletClient]:
    """A PyBullet world that holds nothing but a plane at z = 0 with a smooth random texture."""
    bullet = connect()
    square = write_textured_square(tmp_path_factory.mktemp("plane"))
    bullet.createMultiBody(0, -1, bullet.createVisualShape(pb.GEOM_MESH, fileName=str(square)), (0.6, 0.0, 0.0))
    yield bullet
    bullet.disconnect()


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


def test_the_first_rows_and_columns_of_inputs_are_those_of_whole_ones() -> None:
    view = PreparedView.from_view(DrawnTable(START).look()[0], pixels_per_cell=1)
    steps = torch.tensor([[0.01, -0.02, 0.3], [0.0, 0.05, -1.2]])
    whole, part = predict_inputs(view, steps, grid=GRID), predict_inputs(view, steps, grid=GRID, side_px=49)
    torch.testing.assert_close(part, whole[..., :49, :49], rtol=0, atol=0)


def test_inputs_are_made_where_the_steps_are_and_in_their_precision() -> None:
    """Devices are told apart by the one that computes nothing: what is made elsewhere cannot be combined with it."""
    view = PreparedView.from_view(DrawnTable(START).look()[0], pixels_per_cell=1)
    elsewhere = predict_inputs(view, torch.zeros(5, 3, device="meta"), grid=GRID)
    assert (elsewhere.device.type, elsewhere.shape) == ("meta", (5, 4, 64, 64))
    single, double = (predict_inputs(view, torch.zeros(1, 3, dtype=dtype), grid=GRID) for dtype in PRECISIONS)
    assert (single.dtype, double.dtype) == PRECISIONS
    torch.testing.assert_close(single.double(), double, atol=1e-3, rtol=0)


PRECISIONS = (torch.float32, torch.float64)


@pytest.mark.parametrize(
    "steps",
    [torch.zeros(2, 3, dtype=dtype) for dtype in (torch.float16, torch.bfloat16, torch.int64, torch.bool)]
    + [torch.zeros(3), torch.zeros(2, 4)],
    ids=str,
)
def test_steps_of_another_type_or_shape_are_refused(steps: torch.Tensor) -> None:
    view = PreparedView.from_view(DrawnTable(START).look()[0], pixels_per_cell=1)
    with pytest.raises(StepError, match=r"expected torch.float32 or torch.float64 of shape \(B, 3\)"):
        predict_inputs(view, steps, grid=GRID)


@pytest.mark.parametrize("grid", [(10**9, 64), (64.0, 64), (400, "64"), (400, True), (None, None)])
def test_a_grid_of_impossible_numbers_is_refused(grid: tuple[Any, Any]) -> None:
    with pytest.raises(ServoSettingsError, match="expected whole numbers"):
        InputGrid(crop_px=grid[0], size_px=grid[1])
