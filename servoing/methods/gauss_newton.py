"""Gauss-Newton ascent (section IV-B): curvature from the gradient alone.

The paper takes H = g^T g for the Hessian. As a matrix, g g^T has rank one and no inverse; its pseudo-inverse gives
p = alpha g / |g|^2, which grows without bound as the surface flattens. Gauss and Newton's step belongs to a residual:
with r(p) = 1 - S(p), what a grasp lacks to certainty, minimising r^2 / 2 gives (g g^T + lambda I) p = r g, so

    p = (1 - S_0) g / (|g|^2 + lambda).

That is the step to S = 1 on the plane through the samples, damped (Levenberg) where the plane is flat. ``literal``
keeps the paper's formula with the pseudo-inverse. docs/servoing.md derives both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.optimiser import Proposal, StepObjective
from handsight.servoing.regression import regress_gradient
from handsight.servoing.sampling import StepRange, uniform_steps


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussNewton:
    """Sample around the current pose, regress the gradient, step to where the plane reaches certainty."""

    samples: int = 96
    range: StepRange = field(default_factory=StepRange)
    learning_rate: float = 1.0
    """Share of the step that is taken: alpha."""
    damping: float = 0.002
    """lambda, in squared units of score per sampling range."""
    literal: bool = False
    """Whether to step by alpha g / |g|^2, without residual and damping, as printed."""
    max_steps: int = 20

    def __post_init__(self) -> None:
        sound = all(math.isfinite(value) and value > 0 for value in (self.learning_rate, self.damping))
        if self.samples < 4 or not sound or self.max_steps < 0:
            raise ServoSettingsError(
                f"Gauss-Newton ascent has samples {self.samples}, learning rate {self.learning_rate}, damping "
                f"{self.damping} and max_steps {self.max_steps}, expected >= 4, > 0, > 0 and >= 0"
            )

    @property
    def min_steps(self) -> int:
        """None: a good start is grasped at once."""
        return 0

    def begin(self) -> GaussNewtonOptimiser:
        """The method keeps no memory between servo steps."""
        return GaussNewtonOptimiser(self)


@dataclass(frozen=True, slots=True)
class GaussNewtonOptimiser:
    """Chooses steps towards certainty."""

    settings: GaussNewton

    def propose(self, objective: StepObjective, score_here: float, rng: np.random.Generator) -> Proposal:
        """Estimate the gradient from samples around the current pose and step along it, within the sampling range."""
        half_width = self.settings.range.scaled(score_here)
        samples = uniform_steps(self.settings.samples, half_width, rng)  # (N, 3)
        scores = objective(samples)
        gradient = regress_gradient(samples / half_width, scores)
        squared = float(gradient.double() @ gradient.double())
        if self.settings.literal:
            length = 1 / squared if squared else 0.0
        else:
            length = (1 - score_here) / (squared + self.settings.damping)
        step = half_width * (self.settings.learning_rate * length * gradient).clamp(-1, 1)
        return Proposal(step=step, samples=samples, scores=scores, gradient=gradient)
