"""Second-order ascent: Newton's method on a sampled paraboloid (section IV-B, eq. 4).

The paper steps by + alpha H^-1 g. At a maximum H is negative definite, so that this step leads *down*; Newton's step to
the top of a paraboloid S_0 + g^T p + 1/2 p^T H p is - H^-1 g. Where H is not negative definite the paraboloid has no
top. Here the curvatures are made negative, each at least as strong as one that takes the step to the edge of the
sampling range: the step then always climbs, is Newton's where there is a top within reach, and goes to the edge along
the gradient where there is none. ``literal`` keeps the paper's formula. docs/servoing.md derives both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.optimiser import Proposal, StepObjective
from handsight.servoing.regression import regress_quadratic
from handsight.servoing.sampling import StepRange, uniform_steps

LITERAL_RATE = 0.05
"""The paper's alpha."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondOrder:
    """Sample around the current pose, regress gradient and Hessian, step to the top of the paraboloid."""

    samples: int = 128
    range: StepRange = field(default_factory=StepRange)
    learning_rate: float = 1.0
    """Share of Newton's step that is taken: alpha."""
    literal: bool = False
    """Whether to step by + alpha H^-1 g with H as regressed, S_0 fixed and no factor 1/2, as printed."""
    max_steps: int = 20

    def __post_init__(self) -> None:
        sound = math.isfinite(self.learning_rate) and self.learning_rate > 0
        if self.samples < 10 or not sound or self.max_steps < 0:
            raise ServoSettingsError(
                f"second-order ascent has samples {self.samples}, learning rate {self.learning_rate} and "
                f"max_steps {self.max_steps}, expected >= 10, > 0 and >= 0"
            )

    @property
    def min_steps(self) -> int:
        """None: a good start is grasped at once."""
        return 0

    def begin(self) -> SecondOrderOptimiser:
        """Newton's method keeps no memory between servo steps."""
        return SecondOrderOptimiser(self)


@dataclass(frozen=True, slots=True)
class SecondOrderOptimiser:
    """Chooses steps to the top of a paraboloid."""

    settings: SecondOrder

    def propose(self, objective: StepObjective, score_here: float, rng: np.random.Generator) -> Proposal:
        """Fit a paraboloid to samples around the current pose and step towards its top, within the sampling range."""
        half_width = self.settings.range.scaled(score_here)
        samples = uniform_steps(self.settings.samples, half_width, rng)  # (N, 3)
        scores = objective(samples)
        fixed = score_here if self.settings.literal else None
        gradient, hessian = regress_quadratic(samples / half_width, scores, score_here=fixed)
        newton = literal_step(gradient, hessian) if self.settings.literal else climbing_step(gradient, hessian)
        step = half_width * (self.settings.learning_rate * newton).clamp(-1, 1)
        return Proposal(step=step, samples=samples, scores=scores, gradient=gradient)


def climbing_step(gradient: Tensor, hessian: Tensor) -> Tensor:
    """Newton's step to the top of a paraboloid whose curvatures are made negative. (3,), (3, 3) -> (3,).

    A curvature -|lambda| leads to |g| / |lambda| along its axis, so a |lambda| of at least |g| keeps the step within a
    range of one.
    """
    curvatures, axes = torch.linalg.eigh(hessian.double())  # (3,), (3, 3) in columns
    slopes = axes.T @ gradient.double()  # (3,)
    steepest = torch.linalg.vector_norm(slopes).clamp_min(1e-12)
    bent = torch.where(curvatures < 0, -curvatures, torch.zeros_like(curvatures)).maximum(steepest)
    newton: Tensor = axes @ (slopes / bent)
    return newton.to(gradient.dtype)


def literal_step(gradient: Tensor, hessian: Tensor) -> Tensor:
    """H^-1 g as printed, H being half the matrix of second derivatives. (3,), (3, 3) -> (3,)."""
    newton: Tensor = torch.linalg.pinv(0.5 * hessian.double()) @ gradient.double()
    return newton.to(gradient.dtype)
