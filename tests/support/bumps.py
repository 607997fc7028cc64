"""Objectives whose best step is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from handsight.servoing.footprint import Footprint
from handsight.servoing.sweep import Sweep

WIDTH = torch.tensor([0.05, 0.05, 0.5])
BEST_STEPS = [(0.03, -0.02, 0.3), (-0.04, 0.04, -0.4), (0.0, 0.05, 0.0)]


@dataclass(frozen=True, slots=True)
class Bump:
    """Predicted success that falls off smoothly around one best step; half a turn changes nothing."""

    best: tuple[float, float, float]
    footprint: Footprint = Footprint(x_min_m=-0.2, x_max_m=0.2, y_min_m=-0.15, y_max_m=0.15)  # noqa: RUF009 - frozen

    def __call__(self, steps: Tensor) -> Tensor:
        """(B, 3) -> (B,)."""
        away = steps - steps.new_tensor(self.best)
        turn = torch.remainder(away[..., 2] + 0.5 * math.pi, math.pi) - 0.5 * math.pi
        away = torch.cat([away[..., :2], turn[..., None]], dim=-1)
        return torch.exp(-0.5 * ((away / WIDTH.to(steps)) ** 2).sum(-1))

    def sweep(self, angle_rad: float, *, every: int = 1) -> Sweep:
        """A lattice of 5 mm."""
        area, pitch_m = self.footprint, 0.005 * every
        y_m, x_m = torch.meshgrid(
            torch.arange(area.y_min_m, area.y_max_m, pitch_m),
            torch.arange(area.x_min_m, area.x_max_m, pitch_m),
            indexing="ij",
        )
        steps = torch.stack([x_m, y_m, torch.full_like(x_m, angle_rad)], dim=-1)
        return Sweep(steps=steps, scores=self(steps), inside=torch.ones_like(x_m, dtype=torch.bool))


def bump(best: tuple[float, float, float]) -> Bump:
    """The bump around a best step."""
    return Bump(best)
