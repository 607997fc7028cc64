"""One grasp attempt: the paper's cycle, phase by phase, on any station."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import PhaseError, UnreachableError
from handsight.collection.policy import PregraspPolicy
from handsight.collection.station import Station
from handsight.datasets.records import PHASES, GraspAttempt, GripperReadings, Outcome, RgbdFrame, SceneObjects
from handsight.servoing.planar import PlanarPose

NOT_MEASURED = float("nan")


def attempt_seed(session_seed: int, number: int) -> np.random.SeedSequence:
    """The seed of attempt ``number``: depends on nothing but the two integers."""
    return np.random.SeedSequence(session_seed, spawn_key=(number,))


def is_held(final_m: float, closed_width_m: float) -> bool:
    """The paper's label: the gripper is not fully closed after the lift (and the shakes)."""
    return final_m > closed_width_m


@dataclass(frozen=True, slots=True)
class AttemptStreams:
    """Independent random streams of one attempt, so that another policy or servo method sees the same scene."""

    scene: np.random.Generator
    policy: np.random.Generator
    servo: np.random.Generator

    @classmethod
    def from_seed(cls, seed: np.random.SeedSequence) -> AttemptStreams:
        """Split a seed; calling it twice on equal seeds gives equal streams."""
        fresh = np.random.SeedSequence(seed.entropy, spawn_key=seed.spawn_key)
        return cls(*(np.random.default_rng(child) for child in fresh.spawn(3)))


@dataclass(slots=True)
class AttemptProgress:
    """What an attempt has measured so far; phases fill it in as they complete."""

    station: Station
    scene: SceneObjects | None = None
    overhead: RgbdFrame | None = None
    pregrasp: RgbdFrame | None = None
    pose: PlanarPose = field(
        default_factory=lambda: PlanarPose(x_m=NOT_MEASURED, y_m=NOT_MEASURED, angle_rad=NOT_MEASURED)
    )
    predicted_success: float = NOT_MEASURED
    pose_base_tool_grasp: NDArray[np.float64] = field(default_factory=lambda: np.full((4, 4), np.nan))
    contact_force_n: float = 0.0
    touched_by: str = ""
    """See :class:`~handsight.collection.station.Descent`."""
    before_m: float = NOT_MEASURED
    closed_m: float = NOT_MEASURED
    lifted_m: float = NOT_MEASURED
    final_m: float = NOT_MEASURED
    phase_s: NDArray[np.float32] = field(default_factory=lambda: np.zeros(len(PHASES), np.float32))
    _booked_s: float = 0.0

    def book(self, phase: str) -> None:
        """Book the station's time since the last call, or since the scene was made, on ``phase``."""
        now_s = self.station.clock_s
        self.phase_s[PHASES.index(phase)] += now_s - self._booked_s
        self._booked_s = now_s


def execute_grasp(progress: AttemptProgress) -> None:
    """The fixed grasp policy from wherever the gripper stands: down until contact or table, close, lift, shake.

    Raises:
        PhaseError: A phase did not complete; ``progress`` holds what was measured before it.
    """
    station = progress.station
    progress.before_m = station.width_m
    descent = station.descend()
    progress.contact_force_n, progress.touched_by = descent.contact_force_n, descent.touched_by
    progress.pose_base_tool_grasp = descent.pose_base_tool
    progress.book("descend")
    progress.closed_m = station.close_gripper()
    progress.book("close")
    progress.lifted_m = station.lift()
    progress.book("lift")
    progress.final_m = station.shake()
    progress.book("shake")


def begin_attempt(progress: AttemptProgress, policy: PregraspPolicy, streams: AttemptStreams) -> None:
    """A new scene, the overhead picture, and the move to the pre-grasp pose that ``policy`` chooses.

    Raises:
        PhaseError: A phase did not complete; ``progress`` holds what was measured before it.
    """
    progress.scene = progress.station.reset(streams.scene)
    progress.book("settle")
    approach(progress, policy, streams)


def approach(progress: AttemptProgress, policy: PregraspPolicy, streams: AttemptStreams) -> None:
    """In a scene that is there: the overhead picture, and the move to the pre-grasp pose that ``policy`` chooses.

    Raises:
        PhaseError: A phase did not complete; ``progress`` holds what was measured before it.
    """
    station = progress.station
    progress.overhead = station.look()
    progress.book("look")
    chosen = policy.choose(station, progress.scene, streams.policy)
    progress.pose, progress.predicted_success = chosen.pose, chosen.predicted_success
    station.reach(progress.pose)
    progress.book("reach")


def run_attempt(
    station: Station,
    policy: PregraspPolicy,
    number: int,
    seed: np.random.SeedSequence,
    *,
    pregrasp_picture: bool = False,
) -> GraspAttempt:
    """Attempt one grasp and record it, whatever happens."""
    started_ns, started = time.time_ns(), time.perf_counter_ns()
    progress = AttemptProgress(station=station)
    outcome, failure = Outcome.ABORTED, ""
    try:
        begin_attempt(progress, policy, AttemptStreams.from_seed(seed))
        if pregrasp_picture:
            progress.pregrasp = station.look()
        execute_grasp(progress)
        outcome = Outcome.HELD if is_held(progress.final_m, station.spec.closed_width_m) else Outcome.EMPTY
    except UnreachableError as error:
        outcome, failure = Outcome.UNREACHABLE, str(error)
    except PhaseError as error:
        failure = str(error)
    return _record(progress, number, outcome, failure, started_ns=started_ns, started=started)


def _record(
    progress: AttemptProgress, number: int, outcome: Outcome, failure: str, *, started_ns: int, started: int
) -> GraspAttempt:
    station = progress.station
    labelled = outcome in (Outcome.HELD, Outcome.EMPTY)
    return GraspAttempt(
        number=number,
        outcome=outcome,
        failure=failure,
        overhead=progress.overhead,
        pregrasp=progress.pregrasp,
        pregrasp_x_m=progress.pose.x_m,
        pregrasp_y_m=progress.pose.y_m,
        pregrasp_angle_rad=progress.pose.angle_rad,
        predicted_success=progress.predicted_success,
        pose_base_tool_grasp=progress.pose_base_tool_grasp,
        contact_force_n=progress.contact_force_n,
        gripper=GripperReadings(
            before_m=progress.before_m,
            closed_m=progress.closed_m,
            lifted_m=progress.lifted_m,
            final_m=progress.final_m,
        ),
        scene=progress.scene,
        truth_held=station.held_in_truth() if labelled else None,
        phase_s=progress.phase_s,
        started_ns=started_ns,
        elapsed_ns=time.perf_counter_ns() - started,
    )
