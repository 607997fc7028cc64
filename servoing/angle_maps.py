"""Predicted success over the whole picture at every angle: the heatmap of figure 8 with the third dimension of a step.

A network that has a dense form scores all positions of one angle in a pass over the turned picture (``sweep.py``). Its
lattice is turned against the picture, so the scores are read off it between its points: bilinearly, from a lattice
twice as fine where there is one. At angle 0 lattice and picture agree, and nothing is read between points. A network
without a dense form is shown the crop of each point by itself, which is exact and takes far longer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.heatmap import Heatmap, heatmap_of_sweep, lattice_spacing
from handsight.servoing.objective import Objective
from handsight.servoing.scorer import GraspScorer
from handsight.servoing.sweep import Sweep, is_dense
from handsight.servoing.view import View

MOST_ANGLES = 180
"""One for every degree of half a circle, which is all that two equal jaws can tell apart."""
_BATCH = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleMaps:
    """Scores on a regular grid of raw pixels at each of some angles."""

    scores: NDArray[np.float32]
    """Predicted success. Shape (A, R, C)."""
    angles_rad: NDArray[np.float64]
    """Turns of the gripper against its current angle, ascending over half a circle. Shape (A,)."""
    columns_px: NDArray[np.float32]
    """Column of each grid point in the raw picture. Shape (C,)."""
    rows_px: NDArray[np.float32]
    """Row of each grid point in the raw picture. Shape (R,)."""
    dense: bool
    """Whether each angle was one pass of the network; then turned maps are read off between points of a lattice."""

    def at(self, index: int) -> Heatmap:
        """The map of one angle."""
        return Heatmap(
            scores=self.scores[index],
            columns_px=self.columns_px,
            rows_px=self.rows_px,
            angle_rad=float(self.angles_rad[index]),
        )

    @property
    def straight(self) -> int:
        """Index of the angle nearest to no turn."""
        return int(np.abs(self.angles_rad).argmin())

    @property
    def best(self) -> NDArray[np.float32]:
        """The highest score of each point over all angles. Shape (R, C)."""
        highest: NDArray[np.float32] = self.scores.max(axis=0)
        return highest

    @property
    def best_angle_rad(self) -> NDArray[np.float64]:
        """The angle of that score. Shape (R, C)."""
        angles: NDArray[np.float64] = self.angles_rad[self.scores.argmax(axis=0)]
        return angles

    @property
    def best_map(self) -> Heatmap:
        """The map of the angle at which the very best score is."""
        return self.at(int(self.scores.max(axis=(1, 2)).argmax()))


def angles_over_half_a_circle(count: int) -> NDArray[np.float64]:
    """``count`` angles with equal gaps, 0 among them. Shape (count,).

    Raises:
        ServoSettingsError: There are none, or more than one for every degree.
    """
    if not 1 <= count <= MOST_ANGLES:
        raise ServoSettingsError(f"angles is {count}, expected 1 to {MOST_ANGLES}")
    return np.asarray(math.pi / count * (np.arange(count, dtype=np.float64) - count // 2), dtype=np.float64)


def angle_maps(
    view: View, scorer: GraspScorer, *, angles: int = 18, spacing_px: int = 8, view_plane_m: float | None = None
) -> AngleMaps:
    """Score all positions of a picture at all angles.

    Args:
        view: The picture.
        scorer: The network.
        angles: How many, over half a circle; 0 is among them.
        spacing_px: Raw pixels between points, rounded to whole pixels of the network's input.
        view_plane_m: Distance of the plane at the height where grasps begin [m], for a picture that was taken at
            another one; None means that it was taken there.

    Raises:
        ServoSettingsError: The number of angles or the spacing is out of range.
        ScoreError: A score is not in [0, 1].
    """
    turns_rad = angles_over_half_a_circle(angles)
    every = lattice_spacing(view, scorer, spacing_px, view_plane_m=view_plane_m)
    objective = Objective(view, scorer, view_plane_m=view_plane_m)
    dense = is_dense(scorer)
    with torch.no_grad():
        straight = objective.sweep(0.0, every=every)
        maps = [
            straight.scores
            if angle_rad == 0
            else _turned(objective, straight, angle_rad, every)
            if dense
            else _crop_by_crop(objective, straight, angle_rad)
            for angle_rad in turns_rad.tolist()
        ]
    grid = heatmap_of_sweep(view, straight)
    return AngleMaps(
        scores=torch.stack(maps).numpy(force=True),
        angles_rad=turns_rad,
        columns_px=grid.columns_px,
        rows_px=grid.rows_px,
        dense=dense,
    )


def _turned(objective: Objective, straight: Sweep, angle_rad: float, every: int) -> Tensor:
    """Scores at one angle, read off the turned lattice at the points of the straight one. Shape (R, C)."""
    swept = objective.sweep(angle_rad, every=max(1, every // 2))
    along, across = (_axes(steps, angle_rad) for steps in (straight.steps, swept.steps))
    # Row and column of each point on the turned lattice, on the scale of grid_sample: -1 and 1 are its outer points.
    first, last = across[0, 0], across[-1, -1]
    places = 2 * (along - first) / (last - first).clamp_min(torch.finfo(along.dtype).eps) - 1
    read = functional.grid_sample(swept.scores[None, None], places[None], padding_mode="border", align_corners=True)
    return read[0, 0].clamp(0, 1)


def _axes(steps: Tensor, angle_rad: float) -> Tensor:
    """Where steps lead, in metres along the axes of a tool turned by ``angle_rad``. (R, C, 3) -> (R, C, 2)."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    x_m, y_m = steps[..., 0], steps[..., 1]
    return torch.stack([cos * x_m + sin * y_m, -sin * x_m + cos * y_m], dim=-1)


def _crop_by_crop(objective: Objective, straight: Sweep, angle_rad: float) -> Tensor:
    """Scores at one angle of the points of the straight lattice, each by itself. Shape (R, C)."""
    rows, columns, _ = straight.steps.shape
    steps = straight.steps.reshape(-1, 3).clone()
    steps[:, 2] = angle_rad
    scores = [objective(batch) for batch in steps.split(_BATCH)]
    return torch.cat(scores).reshape(rows, columns)
