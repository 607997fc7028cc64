"""Collecting on a rig: one station in this process, every attempt committed before it is told of.

A rig does not repeat itself, so an attempt that was reported must be on disk: a commit takes some hundredths of the
time of a grasp. Whatever ends a session, the same call with ``resume`` goes on behind the last attempt.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.collector import CollectReport, CollectSettings, open_writer, session_header
from handsight.collection.errors import CollectionError, RigPausedError
from handsight.collection.ur10.alarm import sound_alarm
from handsight.collection.ur10.guards import SuccessWindow
from handsight.collection.ur10.rig import GuardConfig
from handsight.collection.ur10.station import Ur10Station
from handsight.collection.ur10.station_factory import Ur10StationFactory
from handsight.datasets.errors import DatasetError
from handsight.datasets.records import GraspAttempt

if TYPE_CHECKING:
    from handsight.datasets.store.repository import GraspRepository
    from handsight.datasets.writing.writer import SessionWriter


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
        DeviceError: A device is missing from the start; with ``resume`` the alarm has told of it, as a service may have
            begun the session anew.
        StorageError: The dataset cannot be opened for writing.
        Exception: What nobody thought of; the alarm has told of it.
    """
    header = replace(session_header(factory, settings), seed=None)
    writer = open_writer(repository, header, resume=resume)
    resumed_from = kept = writer.next_number
    successes, paused = 0, ""
    with closing(writer):
        if resumed_from < settings.attempts:
            with closing(_opened(factory, unattended=resume)) as station:
                try:
                    for attempt in _committed(station, writer, settings, factory.rig.guards):
                        kept += 1
                        successes += attempt.success
                        if on_attempt is not None:
                            on_attempt(attempt, kept)
                except RigPausedError as error:
                    paused = str(error)
            if not paused:
                writer.seal()
    return RigReport(
        session=writer.session, resumed_from=resumed_from, attempts=kept, successes=successes, paused=paused
    )


def _opened(factory: Ur10StationFactory, *, unattended: bool) -> Ur10Station:
    try:
        return factory()
    except CollectionError as error:
        if unattended:
            sound_alarm(factory.rig.alarm, f"handsight rig {factory.rig.robot.address} cannot begin: {error}")
        raise


def _committed(
    station: Ur10Station, writer: SessionWriter, settings: CollectSettings, guards: GuardConfig
) -> Iterator[GraspAttempt]:
    """Attempts, each once it is committed.

    Raises:
        RigPausedError: A person has to come; everybody was told.
    """
    window = SuccessWindow(guards)
    for number in range(writer.next_number, settings.attempts):
        with _alarmed(station):
            attempt = run_attempt(
                station,
                settings.policy,
                number,
                attempt_seed(settings.seed, number),
                pregrasp_picture=settings.pregrasp_picture,
            )
        with _paused_by_storage(station):
            writer.append(attempt)
            writer.commit()
        yield attempt
        if fault := window.add(attempt):
            station.pause(fault)
            raise RigPausedError(fault)


@contextmanager
def _paused_by_storage(station: Ur10Station) -> Iterator[None]:
    """What cannot be kept pauses the rig: the attempt was told to nobody, and the next one would be lost too."""
    try:
        yield
    except (DatasetError, OSError) as error:
        reason = f"the attempt cannot be kept: {error}"
        station.pause(reason)
        raise RigPausedError(reason) from error


@contextmanager
def _alarmed(station: Ur10Station) -> Iterator[None]:
    """Nobody watches an unattended rig: that it ended has to be told, whatever ended it."""
    try:
        yield
    except RigPausedError:
        raise
    except Exception as error:
        station.pause(f"{type(error).__name__}: {error}")
        raise
