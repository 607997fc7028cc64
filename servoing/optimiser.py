"""The seam between the servo loop and the methods that choose its steps."""

from __future__ import annotations

from dataclasses import Field, asdict, dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from torch import Tensor

from handsight.servoing.errors import UnknownMethodError
from handsight.servoing.footprint import Footprint
from handsight.servoing.sweep import Sweep


class StepObjective(Protocol):
    """What a method climbs: predicted success of steps from the current view (eq. 3)."""

    @property
    def footprint(self) -> Footprint:
        """What the picture shows, as steps of the gripper: beyond it everything is guessed."""

    def __call__(self, steps: Tensor) -> Tensor:
        """Predicted success of steps (dx [m], dy [m], dangle [rad]). (B, 3) -> (B,)."""

    def sweep(self, angle_rad: float, *, every: int = 1) -> Sweep:
        """Predicted success of every position in the picture at one angle, ``every`` network pixels apart."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """What an optimiser chose, and what it looked at."""

    step: Tensor
    """(dx [m], dy [m], dangle [rad]) in the current tool frame. Shape (3,)."""
    samples: Tensor
    """Every step that was scored. Shape (N, 3)."""
    scores: Tensor
    """Their predicted success. Shape (N,)."""
    gradient: Tensor | None = None
    """Estimated gradient of S in units of the sampling range, where the method has one. Shape (3,)."""


class Optimiser(Protocol):
    """Chooses the next step of one servo run; may remember its earlier steps."""

    def propose(self, objective: StepObjective, score_here: float, rng: np.random.Generator) -> Proposal:
        """Choose a step from the current view.

        Args:
            objective: What to climb.
            score_here: S_0, predicted success of not moving.
            rng: Source of all randomness.
        """


class Method(Protocol):
    """Settings of a servo method, as a dataclass; begins a fresh optimiser for every servo run."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def max_steps(self) -> int:
        """Moves after which the best pose seen is grasped."""

    @property
    def min_steps(self) -> int:
        """Moves before which nothing is grasped, however good it looks."""

    def begin(self) -> Optimiser:
        """An optimiser that has seen nothing yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoMethod:
    """A method and what it is called."""

    name: str
    """As it is typed."""
    label: str
    """As figures call it, in short lines."""
    settings: Method | None = None
    """None for a baseline that grasps from where it starts."""
    paper_rate: float | None = None
    """Success that the paper reports for it on novel objects; None where it reports none."""

    @property
    def max_steps(self) -> int:
        """Moves after which the best pose seen is grasped."""
        return 0 if self.settings is None else self.settings.max_steps

    @property
    def min_steps(self) -> int:
        """Moves before which nothing is grasped, however good it looks."""
        return 0 if self.settings is None else self.settings.min_steps

    def to_json(self) -> dict[str, Any]:
        """Everything that decides its steps beside the view, the network and the random stream, as JSON values."""
        if self.settings is None:
            return {"name": self.name, "optimiser": None, "settings": {}}
        return {"name": self.name, "optimiser": type(self.settings).__name__, "settings": asdict(self.settings)}

    def begin(self) -> Optimiser:
        """An optimiser that has seen nothing yet.

        Raises:
            UnknownMethodError: The method does not servo.
        """
        if self.settings is None:
            raise UnknownMethodError(f"method is {self.name!r}, which does not servo, expected one that does")
        return self.settings.begin()
