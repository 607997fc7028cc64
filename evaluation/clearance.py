"""Clearing tables: grasp after grasp in one scene until nothing is left, as VGN and GG-CNN are measured.

A table begins as the trial of its number does, the same for every method. What is grasped is taken away, and the next
grasp begins around another of the objects left. It ends when no object is left in reach, or when so many grasps in a
row bring nothing. A grasp that is aborted counts as a trial does, in no rate, but it is one of those in a row.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from handsight.collection.attempt import AttemptProgress, AttemptStreams, approach, attempt_seed, begin_attempt
from handsight.collection.errors import PhaseError
from handsight.collection.policy import UniformPolicy
from handsight.collection.station import ClearingStation, Station
from handsight.datasets.errors import below_least, counted
from handsight.evaluation.errors import EvaluationSettingsError
from handsight.evaluation.evaluate import TrialContext, TrialContextFactory
from handsight.evaluation.trial import Trial, servo_and_grasp
from handsight.jobs.engine import LOCAL, Engine
from handsight.jobs.ordered import map_ordered
from handsight.servoing.loop import ServoSettings
from handsight.servoing.methods.registry import RANDOM, check_methods
from handsight.servoing.scorer import GraspScorer

FIRST_OF_GRASPS = 3
"""Children of a table's seed that are the streams of its first grasp: scene, start and servoing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearanceSettings:
    """What to compare."""

    methods: tuple[str, ...]
    tables: int
    """Tables that each method clears; table i begins alike for all of them."""
    failures: int = 3
    """Grasps in a row that bring nothing and end a table."""
    seed: int = 1_000_000
    """Tables are the scenes of the trials of this seed."""
    workers: int = 2
    servo: ServoSettings = field(default_factory=ServoSettings)

    def __post_init__(self) -> None:
        check_methods(self.methods)
        faults = below_least(self, tables=1, failures=1, seed=0, workers=1)
        if faults:
            raise EvaluationSettingsError("; ".join(faults))


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearedTable:
    """What one method made of one table."""

    number: int
    method: str
    objects: int
    """Objects on it; 0 where the scene did not come to rest, and nothing was tried."""
    cleared: int
    """Objects taken away."""
    attempts: int
    """Grasps that count."""
    successes: int
    """Those whose label is success."""
    aborted: int
    """Grasps in which nothing was grasped, for no fault of the method."""
    stopped: str
    """Empty where no object was left in reach; otherwise why it ended before."""


@dataclass(slots=True)
class _Tally:
    """A table while it is cleared."""

    objects: int = 0
    cleared: int = 0
    attempts: int = 0
    successes: int = 0
    aborted: int = 0
    in_a_row: int = 0
    """Grasps since the last success, aborted ones among them."""

    def count(self, trial: Trial) -> None:
        """One grasp more."""
        self.attempts += not trial.aborted
        self.aborted += trial.aborted
        self.successes += trial.success
        self.in_a_row = 0 if trial.success else self.in_a_row + 1

    def table(self, number: int, method: str, stopped: str = "") -> ClearedTable:
        """What came of it."""
        return ClearedTable(
            number=number,
            method=method,
            objects=self.objects,
            cleared=self.cleared,
            attempts=self.attempts,
            successes=self.successes,
            aborted=self.aborted,
            stopped=stopped,
        )


def clear_table(
    station: Station, scorer: GraspScorer | None, method: str, number: int, settings: ClearanceSettings
) -> ClearedTable:
    """Grasp until table ``number`` is clear, or too many grasps in a row bring nothing.

    Raises:
        EvaluationSettingsError: The station cannot go on in the same scene.
    """
    if not isinstance(station, ClearingStation):
        raise EvaluationSettingsError(
            f"station is {type(station).__name__}, which makes a new scene for every grasp, expected one that "
            "can go on in the same; use the simulated station"
        )
    tally, scene = _Tally(), None
    for grasp in itertools.count():
        streams = _streams(settings.seed, number, grasp)
        progress = AttemptProgress(station=station, scene=scene)
        begin = partial(begin_attempt if grasp == 0 else approach, progress, UniformPolicy(), streams)
        trial, _ = servo_and_grasp(progress, begin, scorer, method, number, rng=streams.servo, settings=settings.servo)
        if progress.scene is None:
            return tally.table(number, method, stopped=trial.failure)
        tally.objects = tally.objects or len(progress.scene.catalogue_index)
        tally.count(trial)
        try:
            after = station.go_on(streams.scene, held=trial.success)
        except PhaseError as error:
            return tally.table(number, method, stopped=str(error))
        tally.cleared += after.taken
        if after.scene is None:
            break
        if tally.in_a_row == settings.failures:
            said = f"{counted(tally.in_a_row, 'grasp')} in a row brought nothing"
            return tally.table(number, method, stopped=f"{said}, the last: {trial.failure}" if trial.failure else said)
        scene = after.scene
    return tally.table(number, method)


def clear_tables(
    factory: TrialContextFactory,
    settings: ClearanceSettings,
    *,
    known: Sequence[ClearedTable] = (),
    engine: Engine = LOCAL,
    on_table: Callable[[ClearedTable], None] | None = None,
) -> list[ClearedTable]:
    """Every table with every method; the results do not depend on the number of workers.

    Args:
        factory: Opens a station and a network in each worker.
        settings: What to compare.
        known: Tables of an earlier call with the same settings, which are not cleared again.
        engine: Where the workers run.
        on_table: Called with each new table, in the order of their numbers and methods.

    Returns:
        All tables, the known ones that were asked for among them, in that order.

    Raises:
        EvaluationSettingsError: The station cannot go on in the same scene.
        WorkerDiedError: A worker process died.
    """
    wanted = [(number, method) for number in range(settings.tables) for method in settings.methods]
    done = {(table.number, table.method): table for table in known}
    missing = [task for task in wanted if task not in done]
    work = partial(_of_context, settings=settings)
    for table in map_ordered(factory, work, missing, workers=settings.workers, engine=engine, noun="table"):
        done[table.number, table.method] = table
        if on_table is not None:
            on_table(table)
    return [done[task] for task in wanted]


def _of_context(context: TrialContext, task: tuple[int, str], *, settings: ClearanceSettings) -> ClearedTable:
    number, method = task
    return clear_table(context.station, None if method == RANDOM else context.scorer, method, number, settings)


def _streams(seed: int, number: int, grasp: int) -> AttemptStreams:
    """Those of the trial for the first grasp of a table, and independent ones for each further grasp."""
    if grasp == 0:
        return AttemptStreams.from_seed(attempt_seed(seed, number))
    return AttemptStreams.from_seed(np.random.SeedSequence(seed, spawn_key=(number, FIRST_OF_GRASPS + grasp - 1)))
