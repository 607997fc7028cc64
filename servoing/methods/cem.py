"""Cross-entropy method on the predicted success (section IV-A)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.optimiser import Proposal, StepObjective
from handsight.servoing.sampling import StepRange, gaussian_steps


@dataclass(frozen=True, slots=True, kw_only=True)
class Cem:
    """Sample, keep the elite, refit. One iteration per servo step is the paper's faster and better variant."""

    samples: int = 256
    elite: int = 24
    iterations: int = 1
    range: StepRange = field(default_factory=StepRange)
    max_steps: int = 10

    def __post_init__(self) -> None:
        if not 1 <= self.elite <= self.samples or self.iterations < 1 or self.max_steps < 0:
            raise ServoSettingsError(
                f"CEM has elite {self.elite} of samples {self.samples}, iterations {self.iterations} and max_steps "
                f"{self.max_steps}, expected 1 <= elite <= samples, iterations >= 1, steps >= 0"
            )

    @property
    def min_steps(self) -> int:
        """None: a good start is grasped at once."""
        return 0

    def begin(self) -> CemOptimiser:
        """CEM keeps no memory between servo steps."""
        return CemOptimiser(self)


@dataclass(frozen=True, slots=True)
class CemOptimiser:
    """Chooses steps by the cross-entropy method."""

    settings: Cem

    def propose(self, objective: StepObjective, score_here: float, rng: np.random.Generator) -> Proposal:
        """Refit a Gaussian to the elite ``iterations`` times and step to the best pose found.

        The last elite's mean competes with its best sample: over one object the mean is the better grasp, between two
        objects it is none.
        """
        half_width = self.settings.range.scaled(score_here)
        deviation = 0.5 * half_width
        mean = torch.zeros_like(deviation)
        seen, seen_scores = [], []
        for _ in range(self.settings.iterations):
            steps = mean + gaussian_steps(self.settings.samples, deviation, rng)  # (N, 3)
            steps = steps.clamp(-half_width, half_width)
            scores = objective(steps)
            elite = steps[scores.topk(self.settings.elite).indices]
            mean, deviation = elite.mean(0), elite.std(0, correction=0)
            seen.append(steps)
            seen_scores.append(scores)
        seen.append(mean[None])
        seen_scores.append(objective(mean[None]))
        samples, all_scores = torch.cat(seen), torch.cat(seen_scores)
        return Proposal(step=samples[all_scores.argmax()], samples=samples, scores=all_scores)
