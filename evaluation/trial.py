"""One evaluation trial: a fresh scene, a random pre-grasp pose, a servo method, the fixed grasp (section V-B.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handsight.collection.attempt import (
    AttemptProgress,
    AttemptStreams,
    attempt_seed,
    begin_attempt,
    execute_grasp,
    is_held,
)
from handsight.collection.errors import PhaseError
from handsight.collection.policy import UniformPolicy
from handsight.collection.servo_policy import servo_on_station
from handsight.collection.station import Station
from handsight.datasets.records import RgbdFrame, SceneObjects, StationSpec
from handsight.servoing.loop import ServoSettings, ServoTrace
from handsight.servoing.methods.registry import METHODS
from handsight.servoing.scorer import GraspScorer


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What happened in one trial."""

    number: int
    method: str
    success: bool
    """The label: gripper not fully closed after the lift. False when a phase failed."""
    failure: str
    """Empty, or the phase that failed and why."""
    moves: int
    """Servo moves before the grasp; 0 for random grasps."""
    compute_s: float
    """Mean time per servo step from picture to decision, without camera and robot [s]; NaN for random grasps."""
    truth_held: bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRecording:
    """A trial with everything seen, for looking at it."""

    trial: Trial
    trace: ServoTrace
    station: StationSpec
    scene: SceneObjects | None
    overhead: RgbdFrame


def run_trial(
    station: Station,
    scorer: GraspScorer | None,
    method: str,
    number: int,
    *,
    seed: int,
    settings: ServoSettings,
) -> tuple[Trial, TrialRecording | None]:
    """Run trial ``number``; trials of equal seed and number begin alike, whatever the method.

    Returns:
        The result, and what was seen if there was servoing.

    Raises:
        ScoreError: A score of the network is not in [0, 1]. That is no failure of the trial: nothing is grasped.
    """
    progress = AttemptProgress(station=station)
    streams = AttemptStreams.from_seed(attempt_seed(seed, number))
    trace: ServoTrace | None = None
    failure = ""
    try:
        begin_attempt(progress, UniformPolicy(), streams)
        if scorer is not None and METHODS[method].settings is not None:
            trace = servo_on_station(station, scorer, METHODS[method], settings=settings, rng=streams.servo)
        execute_grasp(progress)
    except PhaseError as error:
        failure = str(error)
    trial = Trial(
        number=number,
        method=method,
        success=not failure and is_held(progress.final_m, station.spec.closed_width_m),
        failure=failure,
        moves=trace.moves if trace else 0,
        compute_s=float(np.mean([step.compute_s for step in trace.steps])) if trace else float("nan"),
        truth_held=None if failure else station.held_in_truth(),
    )
    return trial, _recording(progress, trial, trace)


def _recording(progress: AttemptProgress, trial: Trial, trace: ServoTrace | None) -> TrialRecording | None:
    if trace is None or progress.overhead is None:
        return None
    spec = progress.station.spec
    return TrialRecording(
        trial=trial,
        trace=trace,
        station=spec,
        scene=progress.scene,
        overhead=progress.overhead,
    )
