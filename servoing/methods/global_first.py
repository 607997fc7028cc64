"""A global first step: look everywhere in the first picture before servoing begins.

The paper's methods are local and start from a random pose: an object just out of their range is missed, and a poor
grasp nearby is taken for the best there is. Here the first step goes to the best pose in the whole picture. It costs
one search; the closed loop then corrects what the homography got wrong over so long a step, by any method.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.methods.cem import Cem
from handsight.servoing.optimiser import Optimiser, Proposal, StepObjective
from handsight.servoing.sampling import gaussian_steps


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalSearch:
    """Where a search over a whole picture looks: a lattice at some angles, then around the best of it, ever closer."""

    angles: int = 16
    """Turns over half a circle, all that two equal jaws can tell apart."""
    every: int = 2
    """Network pixels between positions of the lattice."""
    rounds: tuple[int, ...] = (8, 4)
    """Around how many of the best poses each round of refinement looks."""
    samples: int = 64
    """Steps scored around each of them."""
    x_m: float = 0.015
    y_m: float = 0.015
    angle_rad: float = 0.25
    """Standard deviations of these in the first round."""
    narrowing: float = 0.4
    """How much of its deviation each further round keeps."""

    def __post_init__(self) -> None:
        widths = (self.x_m, self.y_m, self.angle_rad, self.narrowing)
        counts = (self.angles, self.every, self.samples, *self.rounds)
        if min(counts) < 1 or not all(math.isfinite(width) and width > 0 for width in widths):
            raise ServoSettingsError(
                f"a global search has angles {self.angles}, every {self.every}, rounds {self.rounds}, samples "
                f"{self.samples}, widths {widths}, expected all of them positive"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalFirst:
    """Step to the best pose in the first picture, then servo by CEM."""

    search: GlobalSearch = field(default_factory=GlobalSearch)
    then: Cem = field(default_factory=lambda: Cem(samples=128, elite=12))
    max_steps: int = 8

    def __post_init__(self) -> None:
        if self.max_steps < 1:
            raise ServoSettingsError(f"max_steps is {self.max_steps}, expected at least 1: the global step is one")

    @property
    def min_steps(self) -> int:
        """One: even a start that looks good enough to grasp is left for the best there is."""
        return 1

    def begin(self) -> GlobalFirstOptimiser:
        """A run whose first step is still to come."""
        return GlobalFirstOptimiser(self.search, self.then.begin())


class GlobalFirstOptimiser:
    """Chooses the first step among all, the others by another method."""

    def __init__(self, search: GlobalSearch, then: Optimiser) -> None:
        """Nothing has been looked at yet."""
        self._search = search
        self._then = then
        self._begun = False

    def propose(self, objective: StepObjective, score_here: float, rng: np.random.Generator) -> Proposal:
        """The best pose in the picture the first time, the other method's choice from then on."""
        if self._begun:
            return self._then.propose(objective, score_here, rng)
        self._begun = True
        return search_everywhere(objective, self._search, rng)


def search_everywhere(objective: StepObjective, search: GlobalSearch, rng: np.random.Generator) -> Proposal:
    """Score all of the picture, then perturbations of its best poses; step to the best of all."""
    steps, scores = _lattice(objective, search, rng)
    deviation = steps.new_tensor([search.x_m, search.y_m, search.angle_rad])
    for best in search.rounds:
        centres = steps[scores.topk(min(best, len(scores))).indices]  # (K, 3)
        spread = gaussian_steps(len(centres) * search.samples, deviation, rng).reshape(len(centres), -1, 3)
        nearby = objective.footprint.clamped((centres[:, None] + spread).reshape(-1, 3))  # (K * samples, 3)
        steps, scores = torch.cat([steps, nearby]), torch.cat([scores, objective(nearby)])
        deviation = search.narrowing * deviation
    return Proposal(step=steps[scores.argmax()], samples=steps, scores=scores)


def _lattice(objective: StepObjective, search: GlobalSearch, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
    """Every position in the picture at every angle. Shapes (N, 3), (N,)."""
    # A random first angle, so that no direction is favoured over many runs.
    spacing_rad = math.pi / search.angles
    first_rad = -0.5 * math.pi + spacing_rad * float(rng.random())
    sweeps = [objective.sweep(first_rad + spacing_rad * at, every=search.every) for at in range(search.angles)]
    steps = torch.cat([one.steps[one.inside] for one in sweeps])
    return steps, torch.cat([one.scores[one.inside] for one in sweeps])
