"""Comparing servo methods on the same trials, on any number of processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import torch

from handsight.collection.collector import StationFactory
from handsight.collection.station import Station
from handsight.datasets.errors import below_least
from handsight.evaluation.errors import EvaluationSettingsError, TrialAbortedError
from handsight.evaluation.trial import Trial, TrialRecording, run_trial
from handsight.evaluation.watching import TrialWatcher, WatcherFactory
from handsight.jobs.engine import LOCAL, Engine
from handsight.jobs.ordered import map_ordered
from handsight.servoing.loop import ServoSettings
from handsight.servoing.methods.registry import RANDOM, check_methods
from handsight.servoing.scorer import GraspScorer
from handsight.training.errors import CheckpointError
from handsight.training.run import load_run


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluationSettings:
    """What to compare."""

    methods: tuple[str, ...]
    trials: int
    """Trials of each method; trial i begins alike for all of them."""
    seed: int = 1_000_000
    """Apart from the seeds of collected data, so that evaluation scenes are new."""
    workers: int = 2
    servo: ServoSettings = field(default_factory=ServoSettings)
    one_look: bool = False
    """Whether methods take their first step and grasp without looking again."""

    def __post_init__(self) -> None:
        check_methods(self.methods)
        faults = below_least(self, trials=1, seed=0, workers=1)
        if faults:
            raise EvaluationSettingsError("; ".join(faults))


@dataclass(frozen=True, slots=True)
class TrialContext:
    """The context of a worker: a station and a network."""

    station: Station
    scorer: GraspScorer
    watcher: TrialWatcher | None = None

    def close(self) -> None:
        """Release the station, and whoever watches."""
        self.station.close()
        if self.watcher is not None:
            self.watcher.close()


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialContextFactory:
    """Opens the context of a worker in its process; survives pickling, as its station factory must."""

    open_station: StationFactory
    run: Path
    """Folder of the trained run."""
    weights_sha256: str | None = None
    """Of the weights that it held when the trials were planned; None takes whatever it holds."""
    watch: WatcherFactory | None = None
    """Who watches the trials; nobody unless given."""

    def __call__(self) -> TrialContext:
        """Open the station and load the network.

        One thread for each worker: with more, workers would only wait for each other.

        Raises:
            CheckpointError: The run is damaged, or another one has taken its place.
        """
        torch.set_num_threads(1)
        # First of all: whoever watches gets ready while the rest is opened.
        watcher = None if self.watch is None else self.watch()
        try:
            run = load_run(self.run)
            if self.weights_sha256 not in (None, run.weights_sha256):
                raise CheckpointError(
                    f"{self.run} holds another network than when the trials began: leave a run in its place while it "
                    "is used, and begin again"
                )
            return TrialContext(self.open_station(), run.scorer(), watcher)
        except BaseException:
            if watcher is not None:
                watcher.close()
            raise


def evaluate(
    factory: TrialContextFactory,
    settings: EvaluationSettings,
    *,
    known: Sequence[Trial] = (),
    engine: Engine = LOCAL,
    on_trial: Callable[[Trial], None] | None = None,
) -> list[Trial]:
    """Run every trial with every method; the results do not depend on the number of workers.

    Args:
        factory: Opens a station and a network in each worker.
        settings: What to compare.
        known: Trials of an earlier call with the same settings, which are not run again.
        engine: Where the workers run.
        on_trial: Called with each new trial, in their order.

    Returns:
        All trials, the known ones that were asked for among them, in the order of their numbers and methods.

    Raises:
        WorkerDiedError: A worker process died.
    """
    wanted = [(number, method) for number in range(settings.trials) for method in settings.methods]
    done = {(trial.number, trial.method): trial for trial in known}
    work = partial(_trial, seed=settings.seed, servo=settings.servo, one_look=settings.one_look)
    missing = [task for task in wanted if task not in done]
    for trial in map_ordered(factory, work, missing, workers=settings.workers, engine=engine):
        done[trial.number, trial.method] = trial
        if on_trial is not None:
            on_trial(trial)
    return [done[task] for task in wanted]


def record_trial(
    factory: TrialContextFactory, method: str, number: int, *, seed: int, servo: ServoSettings
) -> TrialRecording | None:
    """Run one trial again in this process and keep everything seen; None for a method that does not servo.

    Raises:
        TrialAbortedError: Nothing was grasped; see :mod:`~handsight.evaluation.trial`.
    """
    context = factory()
    try:
        trial, recording = run_trial(
            context.station, context.scorer, method, number, seed=seed, settings=servo, watcher=context.watcher
        )
    finally:
        context.close()
    if trial.aborted:
        raise TrialAbortedError(f"trial {number} of seed {seed} was aborted: {trial.failure}; choose another trial")
    return recording


def _trial(context: TrialContext, task: tuple[int, str], *, seed: int, servo: ServoSettings, one_look: bool) -> Trial:
    number, method = task
    scorer = None if method == RANDOM else context.scorer
    return run_trial(
        context.station,
        scorer,
        method,
        number,
        seed=seed,
        settings=servo,
        one_look=one_look,
        watcher=context.watcher,
    )[0]


def method_names(text: str) -> Sequence[str]:
    """The comma-separated names of ``--methods``."""
    return check_methods([name.strip() for name in text.split(",") if name.strip()])
