"""The open loop: a servo method that looks once, takes its first step, and grasps without looking again."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from handsight.collection.errors import UnreachableError
from handsight.collection.station import Station
from handsight.datasets.views import station_view
from handsight.evaluation.comparison import ComparisonRow, comparison_rows
from handsight.evaluation.results import ResultRow, result_rows
from handsight.servoing.loop import ServoSettings, ServoStep, ServoTrace
from handsight.servoing.objective import Objective
from handsight.servoing.optimiser import Proposal, ServoMethod
from handsight.servoing.planar import PlanarPose, PlanarStep
from handsight.servoing.scorer import GraspScorer

if TYPE_CHECKING:
    from handsight.evaluation.trial import Trial


class LoopReport(TypedDict):
    """The open loop, and the closed one against it."""

    rows: list[ResultRow]
    """Of the open loop."""
    comparisons: list[ComparisonRow]
    """Each method against itself with one look, on the same trials."""


def step_after_one_look(
    station: Station,
    scorer: GraspScorer,
    method: ServoMethod,
    *,
    settings: ServoSettings,
    rng: np.random.Generator,
) -> ServoTrace:
    """Take one step of a method from wherever the gripper stands; a step out of reach is not taken.

    Args:
        station: The robot, its gripper at the pre-grasp height.
        scorer: The network.
        method: How to choose the step.
        settings: The threshold from which no step is needed.
        rng: Source of the method's randomness.

    Returns:
        A trace of one pass; its score at the grasp is what was predicted from afar.

    Raises:
        ScoreError: A score of the network is not in [0, 1].
        ImageError: The picture has no valid depth.
        PhaseError: The station has stopped.
    """
    frame = station.look()
    pose = PlanarPose.from_pose_base_tool(frame.pose_base_tool)
    started = time.perf_counter()
    view = station_view(frame, station.spec)
    objective = Objective(view, scorer)
    score = objective.score_here()
    proposal = method.begin().propose(objective, score, rng) if score < settings.threshold else None
    predicted = float(objective(proposal.step[None])[0]) if proposal else score
    step = ServoStep(
        view=view,
        pose=pose,
        score=score,
        proposal=proposal,
        predicted=predicted,
        inputs=objective.inputs_here(),
        compute_s=time.perf_counter() - started,
    )
    target = _reached(station, pose, proposal)
    grasp_score = predicted if target is not pose else score
    return ServoTrace(
        method=method.name,
        threshold=settings.threshold,
        steps=(step,),
        grasp_pose=target,
        grasp_score=grasp_score,
        confident=grasp_score >= settings.threshold,
    )


def _reached(station: Station, pose: PlanarPose, proposal: Proposal | None) -> PlanarPose:
    if proposal is None:
        return pose
    dx_m, dy_m, dangle_rad = proposal.step.tolist()
    target = pose.after(PlanarStep(dx_m=dx_m, dy_m=dy_m, dangle_rad=dangle_rad))
    try:
        station.reach(target)
    except UnreachableError:
        return pose
    return target


def loop_report(
    closed: Mapping[str, Sequence[Trial]], one_look: Mapping[str, Sequence[Trial]], *, methods: Sequence[str]
) -> LoopReport:
    """The open loop, and the closed one against it, of each object set and each method.

    Args:
        closed: Trials of each object set with the loop closed.
        one_look: The same trials with one look.
        methods: Methods that servo.
    """
    report = LoopReport(rows=[], comparisons=[])
    for objects, trials in one_look.items():
        renamed = [replace(trial, method=_name(trial.method)) for trial in trials]
        names = [_name(method) for method in methods]
        report["rows"] += result_rows(renamed, objects=objects, methods=names)
        for method, name in zip(methods, names, strict=True):
            both = [*closed[objects], *renamed]
            report["comparisons"] += comparison_rows(both, objects=objects, methods=(method, name), against=name)
    return report


def _name(method: str) -> str:
    return f"{method}, one look"
