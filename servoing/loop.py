"""The closed servo loop: look, score, step, until the grasp is good enough (section IV, figure 2)."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.levelling import levelled
from handsight.servoing.objective import Objective
from handsight.servoing.optimiser import Proposal, ServoMethod
from handsight.servoing.planar import PlanarPose, PlanarStep
from handsight.servoing.scorer import GraspScorer
from handsight.servoing.view import View

Look = Callable[[], tuple[View, PlanarPose]]
"""Takes a picture and says from which pose."""
Move = Callable[[PlanarPose], bool]
"""Moves the gripper to a pose; False when it cannot be reached, the gripper then stays where it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoSettings:
    """When to stop."""

    threshold: float = 0.95
    """Predicted success above which the grasp is executed (0.95 in simulation, 0.85 on the rig)."""
    level: bool = False
    """Whether views are turned until the table in them is level, for a camera that may have been knocked."""

    def __post_init__(self) -> None:
        if not 0 < self.threshold <= 1:
            raise ServoSettingsError(f"threshold is {self.threshold}, expected in (0, 1]")

    def to_json(self) -> dict[str, Any]:
        """As sessions and journals keep them: levelling where it is asked for, as older ones do not know of it."""
        return {"threshold": self.threshold, **({"level": True} if self.level else {})}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """From what :meth:`to_json` gave.

        Raises:
            KeyError: There is no threshold.
            ServoSettingsError: It is out of range.
        """
        return cls(threshold=values["threshold"], level=values.get("level", False))


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoStep:
    """One pass of the loop: what was seen, what it was worth, what was chosen."""

    view: View
    """As the method was given it."""
    pose: PlanarPose
    score: float
    """S_0, predicted success of grasping from ``pose``."""
    proposal: Proposal | None
    """None on the pass that ended the servo run."""
    predicted: float
    """Predicted success after the chosen step; equals ``score`` on the last pass."""
    inputs: Tensor
    """The network's input at ``pose``. Shape (4, size, size)."""
    predicted_inputs: Tensor | None
    """The input that the homography predicts after the chosen step; None on the last pass. Shape (4, size, size)."""
    look_s: float
    """Time to take the picture [s]."""
    compute_s: float
    """Time from picture to decision, without camera and robot [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoTrace:
    """A whole servo run."""

    method: str
    threshold: float
    steps: tuple[ServoStep, ...]
    grasp_pose: PlanarPose
    """Where the gripper stands at the end, ready to execute the grasp."""
    grasp_score: float
    """Predicted success there."""
    confident: bool
    """Whether the threshold was reached; otherwise the best pose seen was taken."""

    @property
    def moves(self) -> int:
        """How often the gripper moved while servoing, without the return to the best pose."""
        return sum(step.proposal is not None for step in self.steps)


def servo(
    look: Look,
    move: Move,
    scorer: GraspScorer,
    method: ServoMethod,
    *,
    settings: ServoSettings,
    rng: np.random.Generator,
    looks: int | None = None,
    on_step: Callable[[ServoStep], None] | None = None,
) -> ServoTrace:
    """Run the loop from wherever the gripper stands and leave it where the grasp should be executed.

    Args:
        look: Takes a picture.
        move: Moves the gripper.
        scorer: The network.
        method: How to climb its predictions.
        settings: When to stop.
        rng: Source of the method's randomness.
        looks: Pictures after which is grasped where the last step led, unseen; with 1 the loop is open. None takes as
            many as the method's steps need.
        on_step: Called with every pass, before the gripper moves.

    Returns:
        The trace; its last step's pose is the grasp pose unless the best pose seen was an earlier one.

    Raises:
        ScoreError: A score is not in [0, 1]. The gripper stays where it then is, and nothing is to be grasped.
    """
    optimiser = method.begin()
    steps: list[ServoStep] = []
    for taken in range(method.max_steps + 1):
        asked = time.perf_counter()
        view, pose = look()
        seen = time.perf_counter()
        if settings.level:
            view = levelled(view)
        objective = Objective(view, scorer)
        score = objective.score_here()
        proposal = None
        if taken < method.max_steps and (score < settings.threshold or taken < method.min_steps):
            proposal = optimiser.propose(objective, score, rng)
        timing = _Timing(look_s=seen - asked, compute_s=time.perf_counter() - seen)
        steps.append(_record(view, pose, score, objective, proposal, timing))
        if on_step is not None:
            on_step(steps[-1])
        reached = None if proposal is None else _move_within_reach(move, pose, proposal.step)
        if proposal is None or reached is None:
            break
        if len(steps) == looks:
            unseen = float(objective(_step(pose.step_to(reached)))[0])
            return _trace(method, settings, steps, reached, unseen)
    best = max(steps, key=lambda step: step.score)
    if best is not steps[-1] and steps[-1].score < settings.threshold:
        move(best.pose)
    return _trace(method, settings, steps, best.pose, best.score)


def _trace(
    method: ServoMethod, settings: ServoSettings, steps: Sequence[ServoStep], pose: PlanarPose, score: float
) -> ServoTrace:
    return ServoTrace(
        method=method.name,
        threshold=settings.threshold,
        steps=tuple(steps),
        grasp_pose=pose,
        grasp_score=score,
        confident=score >= settings.threshold,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Timing:
    """How long the parts of one pass took."""

    look_s: float
    compute_s: float


def _move_within_reach(move: Move, pose: PlanarPose, step: Tensor) -> PlanarPose | None:
    """Take the step, or a half or a quarter of it where the workspace ends.

    Returns:
        The pose to which it led; None when none of them can be reached.
    """
    targets = (pose.after(_planar(share * step)) for share in (1.0, 0.5, 0.25))
    return next((target for target in targets if move(target)), None)


def _record(
    view: View, pose: PlanarPose, score: float, objective: Objective, proposal: Proposal | None, timing: _Timing
) -> ServoStep:
    predicted_inputs = None if proposal is None else objective.inputs(proposal.step[None])
    return ServoStep(
        view=view,
        pose=pose,
        score=score,
        proposal=proposal,
        predicted=score if predicted_inputs is None else float(objective.scores(predicted_inputs)[0]),
        inputs=objective.inputs_here(),
        predicted_inputs=None if predicted_inputs is None else predicted_inputs[0],
        look_s=timing.look_s,
        compute_s=timing.compute_s,
    )


def _planar(step: Tensor) -> PlanarStep:
    dx_m, dy_m, dangle_rad = step.tolist()
    return PlanarStep(dx_m=dx_m, dy_m=dy_m, dangle_rad=dangle_rad)


def _step(step: PlanarStep) -> Tensor:
    """(1, 3)."""
    return torch.tensor([[step.dx_m, step.dy_m, step.dangle_rad]], dtype=torch.float32)
