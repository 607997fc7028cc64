"""Laws that the affine maps obey, whatever the camera."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.errors import CameraModelError, ServoSettingsError
from handsight.servoing.homography import InputGrid, raw_from_input

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
