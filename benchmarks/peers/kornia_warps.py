"""Network inputs by kornia, the library of differentiable vision for PyTorch, as a peer of our own resampling."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from kornia.geometry.transform import warp_affine
from torch import Tensor

from handsight.servoing.homography import InputGrid, raw_from_input
from handsight.servoing.view import View
from handsight.training.scorer import Scorer


def by_kornia(view: View, scorer: Scorer, steps: Tensor) -> Callable[[], Tensor]:
    """One affine warp of the raw picture for each step, from picture to scores.

    Kornia has no filter before it takes every sixth pixel, and a batch of pictures for a batch of maps; the picture is
    expanded, not copied.

    Args:
        view: The picture.
        scorer: The network.
        steps: Delta poses, shape (B, 3).
    """

    def score() -> Tensor:
        return scorer(kornia_inputs(view, scorer.grid, steps).contiguous())

    return score


def kornia_inputs(view: View, grid: InputGrid, steps: Tensor) -> Tensor:
    """The inputs themselves, without a filter. Shape (B, 4, size, size)."""
    height_m = np.where(view.valid, view.depth_m - np.float32(view.plane_m), np.float32(0))
    picture = torch.from_numpy(np.concatenate([view.rgb.transpose(2, 0, 1).astype(np.float32) / 255, height_m[None]]))
    maps = raw_from_input(view.camera, steps, plane_m=view.plane_m, view_plane_m=view.plane_m, grid=grid)
    last_row = torch.tensor([0.0, 0.0, 1.0]).expand(len(steps), 1, 3)
    to_input = torch.linalg.inv(torch.cat([maps, last_row], 1))[:, :2]  # Kornia wants maps from source to goal.
    side = (grid.size_px, grid.size_px)
    return warp_affine(picture.expand(len(steps), -1, -1, -1), to_input, side, padding_mode="border")
