"""Objectives whose best step is known."""

from __future__ import annotations

import torch
from torch import Tensor

from handsight.servoing.optimiser import ScoreSteps

WIDTH = torch.tensor([0.05, 0.05, 0.5])
BEST_STEPS = [(0.03, -0.02, 0.3), (-0.04, 0.04, -0.4), (0.0, 0.05, 0.0)]


def bump(best: tuple[float, float, float]) -> ScoreSteps:
    """Predicted success that falls off smoothly around one best step."""
    centre = torch.tensor(best)

    def score(steps: Tensor) -> Tensor:
        return torch.exp(-0.5 * (((steps - centre) / WIDTH) ** 2).sum(-1))

    return score
