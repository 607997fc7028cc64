"""First-order ascent on a finite-difference gradient of the predicted success (section IV-B)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from torch import Tensor

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.optimiser import Proposal, StepObjective
from handsight.servoing.regression import regress_gradient
from handsight.servoing.sampling import StepRange, uniform_steps


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstOrder:
    """Sample around the current pose, regress the gradient, step along it with RMSprop."""

    samples: int = 64
    range: StepRange = field(default_factory=StepRange)
    learning_rate: float = 0.5
    """Length of a step in units of the (scaled) sampling range, once RMSprop has settled."""
    decay: float = 0.5
    """How much of the running mean of squared gradients a step keeps."""
    max_steps: int = 20

    def __post_init__(self) -> None:
        sound = math.isfinite(self.learning_rate) and self.learning_rate > 0 and 0 <= self.decay < 1
        if self.samples < 4 or not sound or self.max_steps < 0:
            raise ServoSettingsError(
                f"first-order ascent has samples {self.samples}, learning rate {self.learning_rate}, decay "
                f"{self.decay} and max_steps {self.max_steps}, expected >= 4, > 0, in [0, 1) and >= 0"
            )

    @property
    def min_steps(self) -> int:
        """None: a good start is grasped at once."""
        return 0

    def begin(self) -> FirstOrderOptimiser:
        """An ascent whose running mean is empty."""
        return FirstOrderOptimiser(self)


class FirstOrderOptimiser:
    """Chooses steps along the estimated gradient."""

    def __init__(self, settings: FirstOrder) -> None:
        """Start with an empty running mean of squared gradients."""
        self._settings = settings
        self._mean_square: Tensor | float = 0.0
        self._taken = 0

    def propose(self, objective: StepObjective, score_here: float, rng: np.random.Generator) -> Proposal:
        """Estimate the gradient from samples around the current pose and step along it."""
        half_width = self._settings.range.scaled(score_here)
        samples = uniform_steps(self._settings.samples, half_width, rng)  # (N, 3)
        scores = objective(samples)
        gradient = regress_gradient(samples / half_width, scores)
        step = half_width * self._rmsprop(gradient)
        return Proposal(step=step, samples=samples, scores=scores, gradient=gradient)

    def _rmsprop(self, gradient: Tensor) -> Tensor:
        """RMSprop's update with its running mean corrected for the empty start, cut at the sampling range."""
        keep = self._settings.decay
        self._taken += 1
        self._mean_square = keep * self._mean_square + (1 - keep) * gradient**2
        mean_square = self._mean_square / (1 - keep**self._taken)
        update = self._settings.learning_rate * gradient / (mean_square.sqrt() + 1e-8)
        return update.clamp(-1, 1)
