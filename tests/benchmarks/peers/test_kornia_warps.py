"""The peer makes the same pictures, so that its time is that of the same work."""

from __future__ import annotations

import numpy as np
import torch

from benchmarks.peers.kornia_warps import kornia_inputs
from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.servoing.homography import InputGrid, predict_inputs
from handsight.servoing.prepared_view import PreparedView
from handsight.servoing.view import View


def test_kornia_resamples_where_we_do() -> None:
    k = D435_ON_GRIPPER.intrinsics
    column, row = np.meshgrid(np.linspace(0, 1, k.width), np.linspace(0, 1, k.height))
    rgb = (255 * np.dstack([column, row, 0.5 * (column + row)])).astype(np.uint8)  # Smooth: filters change it little.
    view = View(rgb=rgb, depth_m=(0.4 + 0.05 * column * row).astype(np.float32), camera=D435_ON_GRIPPER)
    steps, grid = torch.tensor([[0.0, 0.0, 0.0], [0.03, -0.02, 0.7]]), InputGrid()
    prepared = PreparedView.from_view(view, pixels_per_cell=1)
    ours, theirs = predict_inputs(prepared, steps, grid=grid), kornia_inputs(view, grid, steps)
    torch.testing.assert_close(theirs, ours, atol=2e-3, rtol=0)
