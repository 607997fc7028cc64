"""How far labels hang on less than a robot can repeat: recorded grasps performed again, a little beside.

A simulated attempt can be performed again in the very scene it was in. Performed where it was, it ends as it did. Moved
by what no picture shows and no arm repeats, it says how much of a label could be foreseen at all: where the share of
repeats that hold tells the recorded labels apart better than a network does, the network has more to learn; where it
does not, the labels are what bounds it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypedDict

import numpy as np

from handsight.collection.attempt import AttemptProgress, AttemptStreams, attempt_seed, execute_grasp, is_held
from handsight.collection.errors import PhaseError
from handsight.collection.recorded_stations import RecordedStations, StationOpener
from handsight.collection.station import Station
from handsight.datasets.errors import below_least
from handsight.evaluation.errors import EvaluationSettingsError
from handsight.evaluation.results import wilson_95
from handsight.jobs.ordered import map_ordered
from handsight.servoing.planar import PlanarPose, PlanarStep
from handsight.training.metrics import evaluate_scores

MOST_SHIFT_M = 0.1
MOST_TURN_RAD = 0.5 * math.pi


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatSettings:
    """How often, and how far beside."""

    repeats: int = 4
    """Times that each grasp is performed again."""
    shift_m: float = 0.001
    """Standard deviation along each axis [m]; with no turn either, grasps are performed where they were."""
    turn_rad: float = math.radians(1)
    """Standard deviation of the angle [rad]."""
    seed: int = 0
    """What the displacements are drawn from."""
    workers: int = 2

    def __post_init__(self) -> None:
        faults = below_least(self, repeats=1, seed=0, workers=1)
        if not 0 <= self.shift_m <= MOST_SHIFT_M:
            faults.append(f"shift is {self.shift_m * 1e3:g} mm, expected 0 to {MOST_SHIFT_M * 1e3:g}")
        if not 0 <= self.turn_rad <= MOST_TURN_RAD:
            faults.append(f"turn is {math.degrees(self.turn_rad):g} deg, expected 0 to {math.degrees(MOST_TURN_RAD):g}")
        if faults:
            raise EvaluationSettingsError("; ".join(faults))


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedGrasp:
    """What has to be known of an attempt to perform it again."""

    attempt: str
    number: int
    session_seed: int
    station: Mapping[str, Any]
    """The settings of its session's station."""
    pose: PlanarPose
    """From which it descended, in the base frame."""
    held: bool
    """Its recorded label."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedGrasp:
    """What came of performing it again."""

    attempt: str
    held: bool
    """As recorded."""
    repeats: tuple[bool | None, ...]
    """Whether each repeat held; None where nothing was grasped, as out of reach."""

    @property
    def ended(self) -> list[bool]:
        """The repeats that grasped."""
        return [held for held in self.repeats if held is not None]


class RepeatabilityRow(TypedDict):
    """What came of the attempts with one recorded label."""

    recorded: str
    """``success`` or ``failure``."""
    attempts: int
    repeats: int
    """Those in which something was grasped, for of the others nobody knows."""
    as_recorded: int
    rate: float | None
    """Repeats that ended as recorded; None where there is none."""
    always: int
    """Attempts of which every repeat did."""
    always_ci95: tuple[float, float]
    """Wilson's interval of their share."""
    not_grasped: int
    """Repeats in which nothing was grasped."""


def repeat_grasp(stations: RecordedStations, grasp: RecordedGrasp, *, settings: RepeatSettings) -> RepeatedGrasp:
    """Perform a grasp again, each time in its scene as it was and a little beside where it was."""
    station = stations.station(grasp.station)
    held = [_once(station, grasp, _beside(grasp, repeat, settings)) for repeat in range(settings.repeats)]
    return RepeatedGrasp(attempt=grasp.attempt, held=grasp.held, repeats=tuple(held))


def repeat_grasps(
    open_station: StationOpener,
    grasps: Sequence[RecordedGrasp],
    settings: RepeatSettings,
    *,
    on_grasp: Callable[[RepeatedGrasp], None] | None = None,
) -> list[RepeatedGrasp]:
    """Perform every grasp again, in order; the results do not depend on the number of workers.

    Args:
        open_station: Opens stations in each worker; must survive pickling.
        grasps: What to perform.
        settings: How often, and how far beside.
        on_grasp: Called with each, in their order.

    Raises:
        WorkerDiedError: A worker process died.
    """
    done = []
    work = partial(repeat_grasp, settings=settings)
    opener = partial(RecordedStations, open_station)
    for grasp in map_ordered(opener, work, grasps, workers=settings.workers, noun="attempt"):
        done.append(grasp)
        if on_grasp is not None:
            on_grasp(grasp)
    return done


def repeatability_rows(grasps: Sequence[RepeatedGrasp]) -> list[RepeatabilityRow]:
    """One row for the successes and one for the failures, each where there are any."""
    by_label = (("success", [one for one in grasps if one.held]), ("failure", [one for one in grasps if not one.held]))
    return [_row(name, some) for name, some in by_label if some]


def foreseeable_auc(grasps: Sequence[RepeatedGrasp]) -> float | None:
    """How well the share of repeats that held tells the recorded labels apart, as an area under the ROC curve.

    A few repeats know that share roughly, so that whoever knew it exactly would do better still. None with one label
    only.
    """
    some = [one for one in grasps if one.ended]
    shares = np.array([np.mean(one.ended) for one in some], np.float32)
    return evaluate_scores(shares, np.array([one.held for one in some], np.float32)).auc


def _once(station: Station, grasp: RecordedGrasp, pose: PlanarPose) -> bool | None:
    progress = AttemptProgress(station=station)
    try:
        station.reset(AttemptStreams.from_seed(attempt_seed(grasp.session_seed, grasp.number)).scene)
        station.reach(pose)
        execute_grasp(progress)
    except PhaseError:
        return None
    return is_held(progress.final_m, station.spec.closed_width_m)


def _beside(grasp: RecordedGrasp, repeat: int, settings: RepeatSettings) -> PlanarPose:
    seed = np.random.SeedSequence([settings.seed, grasp.session_seed], spawn_key=(grasp.number, repeat))
    deviation = (settings.shift_m, settings.shift_m, settings.turn_rad)
    dx_m, dy_m, dangle_rad = np.random.default_rng(seed).normal(0, deviation).tolist()
    return grasp.pose.after(PlanarStep(dx_m=dx_m, dy_m=dy_m, dangle_rad=dangle_rad))


def _row(recorded: str, grasps: Sequence[RepeatedGrasp]) -> RepeatabilityRow:
    ended = [one for one in grasps if one.ended]
    repeats = sum(len(one.ended) for one in ended)
    as_recorded = sum(held == one.held for one in ended for held in one.ended)
    always = sum(all(held == one.held for held in one.ended) for one in ended)
    return RepeatabilityRow(
        recorded=recorded,
        attempts=len(ended),
        repeats=repeats,
        as_recorded=as_recorded,
        rate=as_recorded / repeats if repeats else None,
        always=always,
        always_ci95=wilson_95(always, len(ended)),
        not_grasped=sum(len(one.repeats) - len(one.ended) for one in grasps),
    )
