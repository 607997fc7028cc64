"""Every position of a picture at one angle, scored together: the homography's lattice of network pixels.

At a fixed angle the inputs of two steps that lie whole network pixels apart are crops of one turned picture, so a
network without zero padding scores all of them in one pass (``MapScorer``), exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.footprint import Footprint
from handsight.servoing.homography import InputGrid, judged_from_m, predict_picture
from handsight.servoing.prepared_view import PreparedView
from handsight.servoing.scorer import GraspScorer, MapScorer
from handsight.servoing.scores import check_scores

_CROPS = 256
"""Crops that a scorer without maps is shown at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Scores on a lattice of positions, all with the same turn."""

    steps: Tensor
    """The lattice, in rows and columns along the turned tool's axes. Shape (R, C, 3)."""
    scores: Tensor
    """Predicted success there. Shape (R, C)."""
    inside: Tensor
    """Which positions lie in the picture: a turned lattice has corners outside. Shape (R, C), bool."""


def lattice(
    prepared: PreparedView, *, grid: InputGrid, angle_rad: float, every: int, view_plane_m: float | None = None
) -> Tensor:
    """Steps to positions whole network pixels apart that cover the picture at one angle.

    Args:
        prepared: The picture.
        grid: Crop and size of the network's input.
        angle_rad: The turn.
        every: Network pixels from one position to the next.
        view_plane_m: Distance of the plane in the pictures to predict [m]; None means the height does not change.

    Returns:
        (dx [m], dy [m], dangle [rad]), float32. Shape (R, C, 3).

    Raises:
        ServoSettingsError: The spacing is not positive, or the angle is not finite.
    """
    if every < 1 or not math.isfinite(angle_rad):
        raise ServoSettingsError(f"a sweep has spacing {every} and angle {angle_rad}, expected 1 or more and finite")
    k = prepared.camera.intrinsics
    footprint = Footprint.of(prepared.camera, plane_m=prepared.plane_m)
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    corners = [
        (cos * x_m + sin * y_m, -sin * x_m + cos * y_m)  # in the turned tool's axes
        for x_m in (footprint.x_min_m, footprint.x_max_m)
        for y_m in (footprint.y_min_m, footprint.y_max_m)
    ]
    judged_m = judged_from_m(prepared.camera, grid, prepared.plane_m if view_plane_m is None else view_plane_m)
    pitch_m = every * grid.crop_px / grid.size_px * judged_m
    u_m = _centred([u for u, _ in corners], pitch_m / k.fx)  # (C,)
    v_m = _centred([v for _, v in corners], pitch_m / k.fy)  # (R,)
    v_grid, u_grid = torch.meshgrid(v_m, u_m, indexing="ij")  # (R, C)
    turned = torch.full_like(u_grid, angle_rad)
    return torch.stack([cos * u_grid - sin * v_grid, sin * u_grid + cos * v_grid, turned], dim=-1).float()


def sweep(
    prepared: PreparedView, scorer: GraspScorer, *, angle_rad: float, every: int = 1, view_plane_m: float | None = None
) -> Sweep:
    """Score every position of the lattice; arguments as of :func:`lattice`.

    Raises:
        ServoSettingsError: The spacing is not positive, or the angle is not finite.
        ScoreError: A score is not in [0, 1].
    """
    grid = scorer.grid
    steps = lattice(prepared, grid=grid, angle_rad=angle_rad, every=every, view_plane_m=view_plane_m).to(
        prepared.channels.device
    )
    rows, columns, _ = steps.shape
    picture = predict_picture(
        prepared,
        steps[0, 0],
        grid=grid,
        width_px=every * (columns - 1) + grid.size_px,
        height_px=every * (rows - 1) + grid.size_px,
        view_plane_m=view_plane_m,
    )
    scores = score_windows(scorer, picture, every=every)
    check_scores(scores.flatten().numpy(force=True), rows * columns)
    footprint = Footprint.of(prepared.camera, plane_m=prepared.plane_m)
    return Sweep(steps=steps, scores=scores, inside=footprint.contains(steps))


def is_dense(scorer: GraspScorer) -> bool:
    """Whether the scorer computes all windows of a picture together, not one by one."""
    return isinstance(scorer, MapScorer) and scorer.dense


def score_windows(scorer: GraspScorer, picture: Tensor, *, every: int) -> Tensor:
    """The scores of all windows of a picture, in one pass where the scorer can. (4, H, W) -> (R, C)."""
    if isinstance(scorer, MapScorer):
        return scorer.score_map(picture, every=every)
    return score_each_window(scorer, picture, every=every)


def score_each_window(scorer: GraspScorer, picture: Tensor, *, every: int) -> Tensor:
    """The same, window by window. Only a batch of them is copied at a time. (4, H, W) -> (R, C)."""
    size_px = scorer.grid.size_px
    windows = picture.unfold(1, size_px, every).unfold(2, size_px, every)  # (4, R, C, size, size)
    rows, columns = windows.shape[1:3]
    corners = [(row, column) for row in range(rows) for column in range(columns)]
    batches = [corners[start : start + _CROPS] for start in range(0, len(corners), _CROPS)]
    scores = [scorer(torch.stack([windows[:, row, column] for row, column in batch])) for batch in batches]
    return torch.cat(scores).reshape(rows, columns)


def _centred(corners_m: list[float], pitch_m: float) -> Tensor:
    """Multiples of the pitch within the span of the corners, as much left over on either side."""
    span_m = max(corners_m) - min(corners_m)
    count = int(span_m / pitch_m) + 1
    begin_m = min(corners_m) + 0.5 * (span_m - (count - 1) * pitch_m)
    return begin_m + pitch_m * torch.arange(count, dtype=torch.float64)
