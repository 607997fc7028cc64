"""Predicted inputs against true ones on a station, for steps of every size to the same grasp (section VI-E).

In each scene a grasp is drawn at an object and looked at once: that is the truth. Then the gripper stands a step away
from it, once for every size of step, looks, and the input after the step is predicted. So the truth is the same for all
sizes, and a scene that is hard to predict is so for all of them. Steps either move or turn, not both, to tell the two
apart. Poses are those that the station measures: what the arm misses is no error of the prediction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from handsight.collection.attempt import AttemptProgress, AttemptStreams, attempt_seed, begin_attempt
from handsight.collection.errors import PhaseError, UnreachableError
from handsight.collection.policy import UniformPolicy
from handsight.collection.station import Station
from handsight.datasets.errors import below_least
from handsight.datasets.records import RgbdFrame
from handsight.datasets.views import station_view
from handsight.evaluation.errors import EvaluationSettingsError
from handsight.evaluation.evaluate import TrialContext, TrialContextFactory
from handsight.evaluation.prediction_error import PredictionError, height_at_grasp_m, prediction_error
from handsight.jobs.ordered import map_ordered
from handsight.servoing.errors import ImageError, ScoreError
from handsight.servoing.planar import PlanarPose, PlanarStep
from handsight.servoing.scorer import GraspScorer

Kind = Literal["move", "turn"]
EDGES: Final[dict[Kind, tuple[float, ...]]] = {
    "move": (0.0, 0.01, 0.02, 0.04, 0.08, 0.16),
    "turn": (0.0, math.radians(10), math.radians(30), math.radians(60), math.radians(90)),
}
"""Ends of the bins of step sizes: distance [m] and angle [rad]. One step is drawn from each bin in every scene."""
AT_OBJECT: Final = UniformPolicy(half_range_m=0.02)
"""Where grasps are drawn: close enough to an object that most are over it."""
UNDER_FINGERS_M: Final = 0.02
"""Radius around the grasp point within which an object's height counts [m]: half the width of a small object."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveySettings:
    """How many scenes to look at."""

    scenes: int
    seed: int = 1_000_000
    """Scenes are those of the trials of this seed."""
    workers: int = 2

    def __post_init__(self) -> None:
        faults = below_least(self, scenes=1, seed=0, workers=1)
        if faults:
            raise EvaluationSettingsError("; ".join(faults))


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictionSample:
    """One step to a grasp, and how wrong its predicted input was."""

    kind: Kind
    size: float
    """Distance of the step [m], or its angle [rad]; as drawn."""
    height_m: float
    """Height of the object at the grasp above the table [m]."""
    error: PredictionError


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneSurvey:
    """What came of one scene."""

    number: int
    samples: tuple[PredictionSample, ...]
    unreachable: int
    """Steps that would have begun out of reach; there is no sample of them."""
    failure: str = ""
    """Why there is none at all: the scene or the grasp could not be looked at."""


def survey(
    factory: TrialContextFactory, settings: SurveySettings, *, on_scene: Callable[[SceneSurvey], None] | None = None
) -> list[SceneSurvey]:
    """Look at every scene, in order; the results do not depend on the number of workers.

    Args:
        factory: Opens a station and a network in each worker.
        settings: How many scenes, and which.
        on_scene: Called with each, in their order.

    Raises:
        WorkerDiedError: A worker process died.
    """
    work = partial(_of_context, seed=settings.seed)
    done = []
    for scene in map_ordered(factory, work, range(settings.scenes), workers=settings.workers, noun="scene"):
        done.append(scene)
        if on_scene is not None:
            on_scene(scene)
    return done


def _of_context(context: TrialContext, number: int, *, seed: int) -> SceneSurvey:
    return survey_scene(context.station, context.scorer, number, seed=seed)


def survey_scene(station: Station, scorer: GraspScorer, number: int, *, seed: int) -> SceneSurvey:
    """Scene ``number``: one grasp, and a step to it from every bin of sizes."""
    streams = AttemptStreams.from_seed(attempt_seed(seed, number))
    progress = AttemptProgress(station=station)
    samples, unreachable = [], 0
    try:
        begin_attempt(progress, AT_OBJECT, streams)
        truth = station.look()
        for kind, size, away in _drawn_steps(streams.servo):
            try:
                station.reach(progress.pose.after(away))
            except UnreachableError:
                unreachable += 1
                continue
            samples.append(_sample(station, scorer, truth, kind, size))
    except (PhaseError, ImageError, ScoreError) as error:
        return SceneSurvey(number=number, samples=(), unreachable=0, failure=str(error))
    return SceneSurvey(number=number, samples=tuple(samples), unreachable=unreachable)


def _drawn_steps(rng: np.random.Generator) -> Iterator[tuple[Kind, float, PlanarStep]]:
    """A step away from the grasp for each bin of each kind, with its size; all are drawn whatever comes of them."""
    for low, high in pairwise(EDGES["move"]):
        distance_m, direction_rad = rng.uniform(low, high), rng.uniform(0, 2 * math.pi)
        dx_m, dy_m = distance_m * math.cos(direction_rad), distance_m * math.sin(direction_rad)
        yield "move", distance_m, PlanarStep(dx_m=dx_m, dy_m=dy_m, dangle_rad=0.0)
    for low, high in pairwise(EDGES["turn"]):
        turn_rad = rng.uniform(low, high)
        yield "turn", turn_rad, PlanarStep(dx_m=0.0, dy_m=0.0, dangle_rad=float(rng.choice((-1, 1))) * turn_rad)


def _sample(station: Station, scorer: GraspScorer, truth: RgbdFrame, kind: Kind, size: float) -> PredictionSample:
    """Look from where the gripper stands, and predict the step to where the truth was seen."""
    frame = station.look()
    step = PlanarPose.from_pose_base_tool(frame.pose_base_tool).step_to(
        PlanarPose.from_pose_base_tool(truth.pose_base_tool)
    )
    after = station_view(truth, station.spec)
    camera_height_m = float(station.spec.camera.pose_base_camera(truth.pose_base_tool)[2, 3])
    return PredictionSample(
        kind=kind,
        size=size,
        height_m=height_at_grasp_m(after, camera_height_m=camera_height_m, radius_m=UNDER_FINGERS_M),
        error=prediction_error(station_view(frame, station.spec), after, step, scorer),
    )
