"""Predicted success over the whole picture, for pure translations (section VI-C, figure 8).

The paper's map has a vertical bias, the distance between camera and gripper. Here a pixel of the map is the place on
the table to which the *gripper* would go, so graspable regions lie on their objects.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.homography import judged_from_m
from handsight.servoing.objective import Objective
from handsight.servoing.scorer import GraspScorer
from handsight.servoing.sweep import Sweep
from handsight.servoing.view import View

BATCH = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Heatmap:
    """Scores on a regular grid of raw pixels."""

    scores: NDArray[np.float32]
    """Predicted success of grasping at each grid point, without turning. Shape (R, C)."""
    columns_px: NDArray[np.float32]
    """Column of each grid point in the raw picture. Shape (C,)."""
    rows_px: NDArray[np.float32]
    """Row of each grid point in the raw picture. Shape (R,)."""
    angle_rad: float
    """Turn of the gripper against its current angle at which the map was made."""


def grasp_heatmap(
    view: View,
    scorer: GraspScorer,
    *,
    spacing_px: int = 8,
    angle_rad: float = 0.0,
    view_plane_m: float | None = None,
) -> Heatmap:
    """Score translations over the whole picture, all with the same turn.

    Args:
        view: The picture.
        scorer: The network.
        spacing_px: Raw pixels between points. Without a turn it is rounded to whole pixels of the network's input
            (6.25 raw ones for 64 from 400), because all of those are scored in one pass.
        angle_rad: Turn of the gripper against its current angle. ``angle_maps`` has many at once.
        view_plane_m: Distance of the plane at the height where grasps begin [m], for a picture that was taken at
            another one; None means that it was taken there.

    Raises:
        ServoSettingsError: The spacing is not positive, or no point of it lies in the picture.
        ScoreError: A score is not in [0, 1].
    """
    every = lattice_spacing(view, scorer, spacing_px, view_plane_m=view_plane_m)
    objective = Objective(view, scorer, view_plane_m=view_plane_m)
    if angle_rad == 0:
        return heatmap_of_sweep(view, objective.sweep(0.0, every=every))
    return _brute_force(view, objective, spacing_px, angle_rad)


def lattice_spacing(view: View, scorer: GraspScorer, spacing_px: int, *, view_plane_m: float | None) -> int:
    """Pixels of the network's input nearest to a spacing in raw ones, at least 1.

    Raises:
        ServoSettingsError: The spacing is not positive, or no point of it lies in the picture.
    """
    k = view.camera.intrinsics
    if not 1 <= spacing_px <= min(k.width, k.height):
        raise ServoSettingsError(
            f"heatmap spacing is {spacing_px} px, expected at least 1 and at most {min(k.width, k.height)}, the "
            "shorter side of the picture"
        )
    pitch_px = scorer.grid.crop_px / scorer.grid.size_px
    judged_m = judged_from_m(view.camera, scorer.grid, view.plane_m if view_plane_m is None else view_plane_m)
    pitch_px *= judged_m / view.plane_m
    return max(1, round(spacing_px / pitch_px))


def heatmap_of_sweep(view: View, swept: Sweep) -> Heatmap:
    """The map of a sweep without a turn: its lattice's rows and columns are the picture's."""
    k, plane_m = view.camera.intrinsics, view.plane_m
    columns_px = (swept.steps[0, :, 0] - view.camera.x_tool_camera_m) * k.fx / plane_m + k.cx
    rows_px = (swept.steps[:, 0, 1] - view.camera.y_tool_camera_m) * k.fy / plane_m + k.cy
    return Heatmap(scores=swept.scores.numpy(), columns_px=columns_px.numpy(), rows_px=rows_px.numpy(), angle_rad=0.0)


def _brute_force(view: View, objective: Objective, spacing_px: int, angle_rad: float) -> Heatmap:
    """Each point's crop by itself, where the lattice is turned against the picture."""
    k, plane_m = view.camera.intrinsics, view.plane_m
    columns_px = np.arange(0.5 * (spacing_px - 1), k.width, spacing_px, dtype=np.float32)
    rows_px = np.arange(0.5 * (spacing_px - 1), k.height, spacing_px, dtype=np.float32)
    dx_m = (columns_px - k.cx) * plane_m / k.fx + view.camera.x_tool_camera_m
    dy_m = (rows_px - k.cy) * plane_m / k.fy + view.camera.y_tool_camera_m
    grid_dy_m, grid_dx_m = np.meshgrid(dy_m, dx_m, indexing="ij")
    steps = np.stack([grid_dx_m.ravel(), grid_dy_m.ravel(), np.full(grid_dx_m.size, angle_rad)], axis=1)
    batches = torch.from_numpy(steps.astype(np.float32)).split(BATCH)
    scores = torch.cat([objective(batch) for batch in batches]).numpy()
    return Heatmap(scores=scores.reshape(grid_dx_m.shape), columns_px=columns_px, rows_px=rows_px, angle_rad=angle_rad)
