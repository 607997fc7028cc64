"""Collecting on a rig: one station in this process, every attempt committed before it is told of.

A rig does not repeat itself, so an attempt that was reported must be on disk: a commit takes some hundredths of the
time of a grasp. Whatever ends a session, the same call with ``resume`` goes on behind the last attempt.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.collector import CollectReport, CollectSettings, open_writer, session_header
from handsight.collection.errors import RigPausedError
from handsight.collection.ur10.guards import SuccessWindow
from handsight.collection.ur10.station import Ur10StationFactory
from handsight.datasets.records import GraspAttempt

if TYPE_CHECKING:
    from handsight.datasets.store.repository import GraspRepository


@dataclass(frozen=True, slots=True, kw_only=True)
class RigReport(CollectReport):
    """What a call of :func:`collect_on_rig` did."""

    paused: str
    """Why a person has to come, who was told; empty where the session is complete."""


def collect_on_rig(
    repository: GraspRepository,
    factory: Ur10StationFactory,
    settings: CollectSettings,
    *,
    resume: bool = False,
    on_attempt: Callable[[GraspAttempt, int], None] | None = None,
) -> RigReport:
    """Collect a session on a rig.

    Args:
        repository: Where to.
        factory: The rig.
        settings: How much, and by which policy. Its seed decides poses and not scenes; workers do not matter.
        resume: Go on with the latest session of this rig, calibration and policy, where there is one.
        on_attempt: Called with every attempt once it is committed, and the number that the session then holds.

    Raises:
        DeviceError: A device is missing from the start.
        StorageError: The disk is full, for instance; the dataset is as the last commit left it.
    """
    header = replace(session_header(factory, settings), seed=None)
    writer = open_writer(repository, header, resume=resume)
    resumed_from = writer.next_number
    successes, paused = 0, ""
    window = SuccessWindow(factory.rig.guards)
    with closing(writer):
        if resumed_from < settings.attempts:
            with closing(factory()) as station:
                try:
                    for number in range(resumed_from, settings.attempts):
                        attempt = run_attempt(
                            station,
                            settings.policy,
                            number,
                            attempt_seed(settings.seed, number),
                            pregrasp_picture=settings.pregrasp_picture,
                        )
                        writer.append(attempt)
                        writer.commit()
                        successes += attempt.success
                        if on_attempt is not None:
                            on_attempt(attempt, writer.next_number)
                        if fault := window.add(attempt):
                            station.pause(fault)
                            raise RigPausedError(fault)
                except RigPausedError as error:
                    paused = str(error)
            if not paused:
                writer.seal()
    return RigReport(
        session=writer.session,
        resumed_from=resumed_from,
        attempts=writer.next_number,
        successes=successes,
        paused=paused,
    )
