"""One evaluation trial: a fresh scene, a random pre-grasp pose, a servo method, the fixed grasp (section V-B.2).

A trial is either counted or aborted, and the line between them is the descent. What goes wrong before it is the fault
of the station, of its pictures or of a network that gives no scores: the method has chosen no grasp, so that there is
nothing to count, and the arm stays at the pre-grasp height. From the descent on the method has chosen where to grasp.
An arm that is then blocked, and cannot be lowered or lifted, has failed for that choice, and the trial counts; a device
of a rig that fails by itself has not, and it does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handsight.collection.attempt import (
    AttemptProgress,
    AttemptStreams,
    attempt_seed,
    begin_attempt,
    execute_grasp,
    is_held,
)
from handsight.collection.errors import DeviceFaultError, PhaseError
from handsight.collection.policy import UniformPolicy
from handsight.collection.servo_policy import servo_on_station
from handsight.collection.station import SeesObjects, Station
from handsight.datasets.records import RgbdFrame, SceneObjects, StationSpec
from handsight.datasets.views import station_view
from handsight.evaluation.watching import TrialStart, TrialWatcher
from handsight.servoing.errors import ImageError, ScoreError
from handsight.servoing.loop import ServoSettings, ServoStep, ServoTrace
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
    """Empty, or what went wrong and why."""
    moves: int
    """Servo moves before the grasp; 0 for random grasps."""
    compute_s: float
    """Mean time per servo step from picture to decision, without camera and robot [s]; NaN for random grasps."""
    truth_held: bool | None
    aborted: bool = False
    """Whether nothing was grasped, for a reason that is not the method's; such a trial counts in no rate."""
    score: float | None = None
    """Predicted success at the pose that was grasped; None for random grasps."""
    contact_force_n: float | None = None
    """Force of the contact that ended the descent [N]; 0 where it ended at table height, None where it did not end."""
    contact_height_m: float | None = None
    """Height of the fingertips above the table where the descent ended [m]."""
    closed_m: float | None = None
    """Opening between the jaws once they were closed [m]; None where that was not reached, as for the next two."""
    lifted_m: float | None = None
    """The same after the lift [m]."""
    final_m: float | None = None
    """The same after the shakes, which is what the label is told from [m]."""
    touched_by: str = ""
    """Part of the robot that met what ended the descent: ``finger``, ``palm`` or ``arm``; empty where nothing did, or
    where the station cannot tell."""
    pushed_m: float | None = None
    """How far the object nearest to the grasp has been moved over the table, from the start of the descent to the end
    of the trial [m]; None where the station does not know."""
    steps: tuple[tuple[float, ...], ...] = ()
    """Every pass of the servo loop: predicted success, and the step that was chosen, dx [m], dy [m] and turn [rad]; the
    last one chose none."""


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
    one_look: bool = False,
    watcher: TrialWatcher | None = None,
) -> tuple[Trial, TrialRecording | None]:
    """Run trial ``number``; trials of equal seed and number begin alike, whatever the method.

    With ``one_look`` the method takes its first step and grasps without looking again. A watcher is told of trials that
    servo.

    Returns:
        The result, and what was seen if there was servoing up to a grasp. A trial is aborted where the scene does not
        settle, the starting pose cannot be reached, the camera gives no picture or one without valid depth, or the
        network gives scores that are not one number in [0, 1] for each input.
    """
    progress = AttemptProgress(station=station)
    streams = AttemptStreams.from_seed(attempt_seed(seed, number))
    watched = watcher if scorer is not None and METHODS[method].settings is not None else None

    def begin() -> None:
        begin_attempt(progress, UniformPolicy(), streams)
        if watched is not None and progress.overhead is not None:
            watched.begin(_start(progress, progress.overhead, method, number, settings))

    trial, trace = servo_and_grasp(
        progress,
        begin,
        scorer,
        method,
        number,
        rng=streams.servo,
        settings=settings,
        looks=1 if one_look else None,
        on_step=None if watched is None else watched.step,
    )
    recording = _recording(progress, trial, trace)
    if watched is not None:
        watched.end(recording)
    return trial, recording


def _start(
    progress: AttemptProgress, overhead: RgbdFrame, method: str, number: int, settings: ServoSettings
) -> TrialStart:
    return TrialStart(
        method=method,
        number=number,
        threshold=settings.threshold,
        station=progress.station.spec,
        overhead=overhead,
        scene=progress.scene,
    )


def servo_and_grasp(
    progress: AttemptProgress,
    begin: Callable[[], None],
    scorer: GraspScorer | None,
    method: str,
    number: int,
    *,
    rng: np.random.Generator,
    settings: ServoSettings,
    looks: int | None = None,
    on_step: Callable[[ServoStep], None] | None = None,
) -> tuple[Trial, ServoTrace | None]:
    """Begin, servo and grasp, on whatever scene ``begin`` leaves; aborted or not as :func:`run_trial` says.

    Args:
        progress: What is measured goes there.
        begin: Takes the overhead picture and leaves the gripper at the start.
        scorer: The network; None for methods that do not servo.
        method: Name of the method.
        number: Of the trial.
        rng: Source of the method's randomness.
        settings: When to stop.
        looks: Pictures after which is grasped unseen; None for as many as the method needs.
        on_step: Called with every pass of the loop, before the gripper moves.
    """
    trace: ServoTrace | None = None
    try:
        begin()
        _check_depth(progress)
        if scorer is not None and METHODS[method].settings is not None:
            trace = servo_on_station(
                progress.station, scorer, METHODS[method], settings=settings, rng=rng, looks=looks, on_step=on_step
            )
    except (PhaseError, ImageError, ScoreError) as error:
        return _aborted(number, method, error), None
    return _grasped(progress, number, method, trace), trace


def _check_depth(progress: AttemptProgress) -> None:
    """Refuse an overhead picture without depth, for methods that do not look at it too: all must begin alike."""
    if progress.overhead is not None:
        _ = station_view(progress.overhead, progress.station.spec).plane_m


def _aborted(number: int, method: str, error: Exception) -> Trial:
    return Trial(
        number=number,
        method=method,
        success=False,
        failure=str(error),
        moves=0,
        compute_s=float("nan"),
        truth_held=None,
        aborted=True,
    )


def _grasped(progress: AttemptProgress, number: int, method: str, trace: ServoTrace | None) -> Trial:
    """Execute the grasp from wherever the gripper stands; what comes of it counts, unless a device failed."""
    failure, before_m = "", _objects_m(progress.station)
    try:
        execute_grasp(progress)
    except DeviceFaultError as error:
        return _aborted(number, method, error)
    except PhaseError as error:
        failure = str(error)
    return Trial(
        number=number,
        method=method,
        success=not failure and is_held(progress.final_m, progress.station.spec.closed_width_m),
        failure=failure,
        moves=trace.moves if trace else 0,
        compute_s=float(np.mean([step.compute_s for step in trace.steps])) if trace else float("nan"),
        truth_held=None if failure else progress.station.held_in_truth(),
        aborted=False,
        score=trace.grasp_score if trace else None,
        touched_by=progress.touched_by,
        pushed_m=_pushed_m(before_m, _objects_m(progress.station), progress.pose_base_tool_grasp[:2, 3]),
        steps=_steps(trace) if trace else (),
        **_readings(progress),
    )


def _steps(trace: ServoTrace) -> tuple[tuple[float, ...], ...]:
    """What was predicted and chosen at each pass; see ``Trial.steps``."""
    return tuple(
        (float(step.score), *(map(float, step.proposal.step.tolist()) if step.proposal else ())) for step in trace.steps
    )


def _objects_m(station: Station) -> NDArray[np.float64] | None:
    """Where objects are, (M, 3); None where the station does not know."""
    return station.object_positions_m() if isinstance(station, SeesObjects) else None


def _pushed_m(
    before_m: NDArray[np.float64] | None, after_m: NDArray[np.float64] | None, grasp_m: NDArray[np.float64]
) -> float | None:
    """How far the object that was nearest to a grasp (x, y) has been moved along the table [m]."""
    if before_m is None or after_m is None or not len(before_m) or not np.isfinite(grasp_m).all():
        return None
    nearest = int(np.linalg.norm(before_m[:, :2] - grasp_m, axis=1).argmin())
    return float(np.linalg.norm(after_m[nearest, :2] - before_m[nearest, :2]))


def _readings(progress: AttemptProgress) -> dict[str, float | None]:
    """What was measured in the phases of the grasp; None where one was not reached."""
    height_m = float(progress.pose_base_tool_grasp[2, 3])
    landed = math.isfinite(height_m)
    values = {"closed_m": progress.closed_m, "lifted_m": progress.lifted_m, "final_m": progress.final_m}
    return {
        "contact_force_n": float(progress.contact_force_n) if landed else None,
        "contact_height_m": height_m if landed else None,
        **{name: float(value) if math.isfinite(value) else None for name, value in values.items()},
    }


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
