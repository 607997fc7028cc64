"""A prepared view does not alias, replicates its edges and fills invalid depth."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.nn import functional

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


@pytest.mark.parametrize("factor", [1, 2, 3, 7, 20])
@pytest.mark.parametrize("whole", [True, False])
def test_it_is_the_smoothed_mean_over_cells(factor: int, *, whole: bool) -> None:
    """Against the same filter written as convolutions in float64."""
    k = D435_ON_GRIPPER.intrinsics
    rng = np.random.default_rng(0)
    rgb = rng.integers(0, 256, (k.height, k.width, 3), dtype=np.uint8)
    depth_m = rng.uniform(0.4, 0.5, (k.height, k.width)).astype(np.float32)
    if not whole:
        depth_m[rng.random(depth_m.shape) < 0.3] = 0.0
    view = View(rgb=rgb, depth_m=depth_m, camera=D435_ON_GRIPPER)
    below_m = np.where(view.valid, depth_m - view.plane_m, 0.0)
    stack = torch.from_numpy(np.stack([*np.moveaxis(rgb / 255, -1, 0), below_m, view.valid]))[None]
    stack = functional.pad(stack, (0, -k.width % factor, 0, -k.height % factor), mode="replicate")
    stack = functional.avg_pool2d(stack, factor)
    if factor > 1:
        one_two_one = torch.tensor([0.25, 0.5, 0.25], dtype=torch.float64)
        kernel = (one_two_one[:, None] * one_two_one).expand(5, 1, 3, 3)
        stack = functional.conv2d(functional.pad(stack, (1, 1, 1, 1), mode="replicate"), kernel, groups=5)
    stack = stack[0]
    depth = torch.where(stack[4] > 0, stack[3] / stack[4].clamp_min(1e-6), 0.0)
    expected = torch.cat([stack[:3], depth[None]]).float()
    found = PreparedView.from_view(view, pixels_per_cell=factor).channels
    torch.testing.assert_close(found, expected, rtol=0, atol=2e-6)
