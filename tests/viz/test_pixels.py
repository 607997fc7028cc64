"""Marks over pictures obey the same geometry as the network's inputs."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.heatmap import Heatmap
from handsight.servoing.homography import InputGrid, raw_from_input
from handsight.viz.pixels import PictureFrame, best_step, place_heatmap

metres = st.floats(-0.2, 0.2)
angles = st.floats(-math.pi, math.pi)


@st.composite
def frames(draw: st.DrawFn) -> PictureFrame:
    width, height = draw(st.integers(32, 1280)), draw(st.integers(32, 960))
    focal = st.floats(100, 1500)
    intrinsics = Intrinsics(
        width=width,
        height=height,
        fx=draw(focal),
        fy=draw(focal),
        cx=draw(st.floats(0, width)),
        cy=draw(st.floats(0, height)),
    )
    camera = HandCamera(
        intrinsics=intrinsics, x_tool_camera_m=draw(metres), y_tool_camera_m=draw(metres), z_tool_camera_m=-0.1
    )
    return PictureFrame(camera=camera, plane_m=draw(st.floats(0.1, 1.0)))


@given(frames(), metres, metres, angles)
def test_a_step_is_drawn_where_its_network_input_is_centred(
    frame: PictureFrame, dx_m: float, dy_m: float, angle_rad: float
) -> None:
    steps = torch.tensor([[dx_m, dy_m, angle_rad]], dtype=torch.float64)
    grid = InputGrid()
    maps = raw_from_input(frame.camera, steps, plane_m=frame.plane_m, view_plane_m=frame.plane_m, grid=grid)
    middle = torch.tensor([0.5 * (grid.size_px - 1), 0.5 * (grid.size_px - 1), 1.0], dtype=torch.float64)
    expected_px = (maps[0] @ middle).numpy() + 0.5
    np.testing.assert_allclose(frame.points(steps.numpy())[0], expected_px, atol=1e-6)


@given(metres, metres, angles, st.floats(0.01, 0.2))
def test_jaws_open_along_the_turned_closing_direction(
    dx_m: float, dy_m: float, angle_rad: float, width_m: float
) -> None:
    intrinsics = Intrinsics(width=640, height=480, fx=600, fy=600, cx=320, cy=240)
    camera = HandCamera(intrinsics=intrinsics, x_tool_camera_m=0, y_tool_camera_m=-0.05, z_tool_camera_m=-0.1)
    frame = PictureFrame(camera=camera, plane_m=0.5)
    left_finger, right_finger, closing = frame.jaws((dx_m, dy_m, angle_rad), width_m)
    direction_px = closing[1] - closing[0]
    expected_px = np.array([math.cos(angle_rad), math.sin(angle_rad)]) * width_m * 1200
    np.testing.assert_allclose(direction_px, expected_px, atol=1e-9)
    np.testing.assert_allclose(closing.mean(0), frame.points([(dx_m, dy_m)])[0], atol=1e-9)
    for finger, end in ((left_finger, closing[0]), (right_finger, closing[1])):
        np.testing.assert_allclose(finger.mean(0), end, atol=1e-9)
        assert abs((finger[1] - finger[0]) @ direction_px) < 1e-6


@given(frames(), st.integers(2, 20), st.integers(2, 20), st.integers(1, 32), st.integers(0, 2**32 - 1))
def test_cells_and_the_best_step_come_to_rest_on_their_pixels(
    frame: PictureFrame, rows: int, columns: int, spacing_px: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    first_px = rng.uniform(0, 50, size=2)
    heatmap = Heatmap(
        scores=rng.random((rows, columns)).astype(np.float32),
        columns_px=(first_px[0] + spacing_px * np.arange(columns)).astype(np.float32),
        rows_px=(first_px[1] + spacing_px * np.arange(rows)).astype(np.float32),
        angle_rad=0.3,
    )
    placement = place_heatmap(heatmap)
    for axis, points_px in enumerate((heatmap.columns_px, heatmap.rows_px)):
        drawn_px = placement.scale[axis] * (np.arange(len(points_px)) + 0.5) + placement.translation_px[axis]
        np.testing.assert_allclose(drawn_px, points_px + 0.5, atol=2e-3)
    row, column = np.unravel_index(heatmap.scores.argmax(), heatmap.scores.shape)
    step = best_step(heatmap, frame)
    expected_px = (float(heatmap.columns_px[column]) + 0.5, float(heatmap.rows_px[row]) + 0.5)
    assert frame.points([step])[0] == pytest.approx(expected_px, abs=1e-6)
    assert step[2] == heatmap.angle_rad
