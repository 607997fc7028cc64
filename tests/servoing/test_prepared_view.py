"""A prepared view does not alias, replicates its edges and fills invalid depth."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.servoing.homography import InputGrid, predict_inputs
from handsight.servoing.prepared_view import PreparedView
from handsight.servoing.view import View


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
