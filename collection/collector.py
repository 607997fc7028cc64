"""Collecting a session: attempts from any number of workers, one writer, commits as it goes.

Attempt i of a simulated session depends on (session seed, i) alone. The writer stores attempts in order, so a session
cut off at any moment is a prefix of the whole one, and going on with it ends in the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Protocol

from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.errors import CollectionSettingsError
from handsight.collection.policy import PregraspPolicy, UniformPolicy
from handsight.collection.station import Station
from handsight.datasets.errors import DatasetError, SessionNotFoundError, below_least, counted
from handsight.datasets.records import GraspAttempt, SessionHeader, StationSpec
from handsight.jobs.engine import LOCAL, Engine
from handsight.jobs.errors import WorkerDiedError
from handsight.jobs.ordered import map_ordered

if TYPE_CHECKING:
    # Icechunk and pandas take a second, and settings that make no sense are refused without them.
    from handsight.datasets.store.repository import GraspRepository
    from handsight.datasets.writing.writer import SessionWriter


class StationFactory(Protocol):
    """Opens equal stations in any process; describes them without opening one."""

    @property
    def spec(self) -> StationSpec:
        """The spec of every station it opens."""

    @property
    def objects_per_scene(self) -> int:
        """Largest number of objects in a scene."""

    @property
    def pushable(self) -> bool:
        """Whether its stations are :class:`~handsight.collection.station.Pushable`."""

    def settings(self) -> dict[str, object]:
        """The station's resolved settings, as JSON values."""

    def __call__(self) -> Station:
        """Open a station."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CollectSettings:
    """How much to collect, and how."""

    attempts: int
    """Length of the session, what a resumed one already holds included."""
    seed: int = 0
    workers: int = 2
    commit_every: int = 32
    """Attempts that an interruption can cost at most."""
    policy: PregraspPolicy = field(default_factory=UniformPolicy)
    pregrasp_picture: bool = False
    """Also take a picture at the pre-grasp pose. The paper trains on the overhead one alone (section III-B)."""

    def __post_init__(self) -> None:
        faults = below_least(self, attempts=1, seed=0, workers=1, commit_every=1)
        if faults:
            raise CollectionSettingsError("; ".join(faults))


@dataclass(frozen=True, slots=True, kw_only=True)
class CollectReport:
    """What a call of :func:`collect` did."""

    session: str
    resumed_from: int
    """Attempts that the session already held."""
    attempts: int
    """Attempts that it holds now."""
    successes: int
    """Successes among those added by this call."""


def session_header(factory: StationFactory, settings: CollectSettings) -> SessionHeader:
    """The provenance that a session with these settings records."""
    return SessionHeader(
        station=factory.spec,
        seed=settings.seed,
        objects_per_scene=factory.objects_per_scene,
        config={
            "station": factory.settings(),
            "pregrasp_picture": settings.pregrasp_picture,
            "policy": settings.policy.settings(),
        },
    )


def collect(
    repository: GraspRepository,
    factory: StationFactory,
    settings: CollectSettings,
    *,
    resume: bool = False,
    engine: Engine = LOCAL,
    on_attempt: Callable[[GraspAttempt, int], None] | None = None,
) -> CollectReport:
    """Collect a simulated session into ``repository``.

    Args:
        repository: Where to.
        factory: The station.
        settings: How much.
        resume: Go on with the session of this seed and configuration where there is one.
        engine: Where the workers run. The writer is always here.
        on_attempt: Called with every attempt once it is appended, and the number that the session then holds.

    Raises:
        SessionConflictError: The dataset already holds this session and ``resume`` is not set.
        StorageError: The disk is full, for instance; the dataset is as the last commit left it.
        WorkerDiedError: Workers died over the same attempt again and again; what was finished is committed.
        KeyboardInterrupt: Passed on, like any other error of stations, after what was finished has been committed.
    """
    writer = open_writer(repository, session_header(factory, settings), resume=resume)
    resumed_from = writer.next_number
    work = partial(_attempt, settings=settings)
    numbers = range(resumed_from, settings.attempts)
    successes = 0
    answers = map_ordered(factory, work, numbers, workers=settings.workers, engine=engine, noun="attempt")
    with closing(writer), closing(answers), _commit_on_error(writer):
        for attempt in answers:
            writer.append(attempt)
            successes += attempt.success
            if on_attempt is not None:
                on_attempt(attempt, writer.next_number)
            if writer.next_number % settings.commit_every == 0:
                writer.commit()
        if resumed_from < settings.attempts:
            writer.seal()
    return CollectReport(
        session=writer.session, resumed_from=resumed_from, attempts=writer.next_number, successes=successes
    )


def open_writer(repository: GraspRepository, header: SessionHeader, *, resume: bool) -> SessionWriter:
    """The writer of a new session, or with ``resume`` of the one that this header had before.

    Raises:
        SessionConflictError: The dataset already holds this session and ``resume`` is not set.
    """
    from handsight.datasets.writing.writer import SessionWriter  # once there is something to write; see above

    if resume:
        try:
            return SessionWriter.resume(repository, header)
        except SessionNotFoundError:
            # Cut off before its first commit, or never begun: both mean to begin.
            pass
    return SessionWriter.begin(repository, header)


@contextmanager
def _commit_on_error(writer: SessionWriter) -> Iterator[None]:
    """Commit what was appended before an error of anything but the dataset: a resumed session goes on behind it."""
    try:
        yield
    except DatasetError:
        raise
    except WorkerDiedError as error:
        writer.commit()
        raise WorkerDiedError(
            f"{error}; {counted(writer.next_number, 'attempt')} before it committed: go on with --resume, perhaps with "
            "fewer --workers"
        ) from error
    except BaseException:
        writer.commit()
        raise


def _attempt(station: Station, number: int, *, settings: CollectSettings) -> GraspAttempt:
    return run_attempt(
        station,
        settings.policy,
        number,
        attempt_seed(settings.seed, number),
        pregrasp_picture=settings.pregrasp_picture,
    )
