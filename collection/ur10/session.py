"""Collecting on a rig: one station in this process, every attempt committed before it is told of.

A rig does not repeat itself, so an attempt that was reported must be on disk: a commit takes some hundredths of the
time of a grasp. Whatever ends a session, the same call with ``resume`` goes on behind the last attempt.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.collector import CollectReport, CollectSettings, open_writer, session_header
from handsight.collection.errors import RigPausedError
from handsight.collection.ur10.guards import SuccessWindow
from handsight.collection.ur10.station import Ur10Station, Ur10StationFactory
from handsight.datasets.records import GraspAttempt

if TYPE_CHECKING:
    from handsight.datasets.store.repository import GraspRepository


def collect_on_rig(
    repository: GraspRepository,
    factory: Ur10StationFactory,
    settings: CollectSettings,
    *,
    resume: bool = False,
    on_attempt: Callable[[GraspAttempt, int], None] | None = None,
) -> CollectReport:
    """Collect a session on a rig.

    Args:
        repository: Where to.
        factory: The rig.
        settings: How much, and by which policy. Its seed decides poses and not scenes; workers do not matter.
        resume: Go on with the latest session of this rig, calibration and policy, where there is one.
        on_attempt: Called with every attempt once it is committed, and the number that the session then holds.

    Raises:
        RigPausedError: A person has to come; somebody was told, and what was recorded is kept.
        DeviceError: A device is missing from the start.
        StorageError: The disk is full, for instance; the dataset is as the last commit left it.
    """
    header = replace(session_header(factory, settings), seed=None)
    writer = open_writer(repository, header, resume=resume)
    resumed_from = writer.next_number
    successes = 0
    window = SuccessWindow(factory.rig.guards)
    with closing(writer):
        if resumed_from < settings.attempts:
            with closing(factory()) as station, _told(station):
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
                        raise RigPausedError(fault)
            writer.seal()
        return CollectReport(
            session=writer.session, resumed_from=resumed_from, attempts=writer.next_number, successes=successes
        )


@contextmanager
def _told(station: Ur10Station) -> Iterator[None]:
    """Tell of a pause, whoever asks for it."""
    try:
        yield
    except RigPausedError as error:
        station.pause(str(error))
        raise
