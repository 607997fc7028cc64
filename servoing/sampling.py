"""Candidate steps, drawn from a range that shrinks as the grasp gets better (section IV, adaptive sampling)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from handsight.servoing.errors import ServoSettingsError


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRange:
    """Half-widths of the region in which steps are sought when nothing good is in sight (S_0 = 0)."""

    x_m: float = 0.08
    y_m: float = 0.08
    angle_rad: float = 0.25 * math.pi

    def __post_init__(self) -> None:
        if not (self.x_m > 0 and self.y_m > 0 and 0 < self.angle_rad <= math.pi):
            raise ServoSettingsError(
                f"step range is ({self.x_m} m, {self.y_m} m, {self.angle_rad} rad), expected positive, angle up to pi"
            )

    def scaled(self, score_here: float) -> Tensor:
        """The range times (1 - S_0): wide when the current pose is bad, fine when it is nearly good. Shape (3,).

        A floor of 5 % keeps the search alive when the network is sure of itself and below the threshold.
        """
        return torch.tensor([self.x_m, self.y_m, self.angle_rad]) * max(0.05, 1.0 - score_here)


def gaussian_steps(count: int, deviation: Tensor, rng: np.random.Generator) -> Tensor:
    """Normally distributed steps with the given standard deviations, cut at two of them. (3,) -> (count, 3)."""
    unit = torch.from_numpy(rng.standard_normal((count, 3)).astype(np.float32))
    return unit.clamp(-2, 2).to(deviation) * deviation


def uniform_steps(count: int, half_width: Tensor, rng: np.random.Generator) -> Tensor:
    """Uniformly distributed steps within +-half_width. (3,) -> (count, 3)."""
    return torch.from_numpy(rng.uniform(-1, 1, (count, 3)).astype(np.float32)).to(half_width) * half_width
