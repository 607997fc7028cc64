"""Trials on the real simulator: paired, reproducible, independent of the number of workers."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.support.scorers import FunctionScorer

from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.evaluation.errors import TrialAbortedError
from handsight.evaluation.evaluate import EvaluationSettings, TrialContextFactory, evaluate, record_trial
from handsight.evaluation.trial import Trial, TrialRecording, run_trial
from handsight.evaluation.watching import TrialStart
from handsight.jobs.engine import LOCAL
from handsight.servoing.homography import InputGrid
from handsight.servoing.loop import ServoSettings, ServoStep
from handsight.training.errors import CheckpointError
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.run import DataOrigin, save_run
from handsight.training.settings import TrainSettings

METHODS = ("random", "cem-1", "first-order")


@pytest.fixture(scope="module")
def factory(tmp_path_factory: pytest.TempPathFactory) -> TrialContextFactory:
    """An untrained network: what it prefers is arbitrary, that it is followed is what is tested."""
    run = tmp_path_factory.mktemp("evaluate") / "run"
    torch.manual_seed(0)
    origin = DataOrigin(dataset="none", ref="main", snapshot="", digest="", view="overhead", attempts=0)
    network = GraspQualityNetwork(GqnConfig())
    save_run(run, network, origins=[origin], grid=InputGrid(), settings=TrainSettings())
    return TrialContextFactory(open_station=SimStationFactory(config=SimConfig(objects="blocks-test")), run=run)


def comparable(trials: list[Trial]) -> list[Trial]:
    return [replace(trial, compute_s=0.0) for trial in trials]


def test_results_do_not_depend_on_workers(factory: TrialContextFactory) -> None:
    settings = EvaluationSettings(methods=METHODS, trials=2, workers=1, seed=4)
    alone = evaluate(factory, settings)
    together = evaluate(factory, replace(settings, workers=2))
    assert comparable(alone) == comparable(together)
    assert [(trial.number, trial.method) for trial in alone] == [(n, m) for n in range(2) for m in METHODS]
    assert all(trial.moves > 0 for trial in alone if trial.method != "random")


def test_workers_are_those_of_the_engine(factory: TrialContextFactory) -> None:
    started: list[Executor] = []

    class Counted:
        def start_worker(self) -> Executor:
            started.append(LOCAL.start_worker())
            return started[-1]

        def kill_worker(self, worker: Executor) -> None:
            LOCAL.kill_worker(worker)

    settings = EvaluationSettings(methods=("random",), trials=2, seed=3, workers=2)
    assert comparable(evaluate(factory, settings, engine=Counted())) == comparable(evaluate(factory, settings))
    assert len(started) == 2


def test_methods_begin_alike(factory: TrialContextFactory) -> None:
    """Same scene, same overhead picture, same first view: only the method differs."""
    recordings = [record_trial(factory, name, 0, seed=4, servo=ServoSettings()) for name in ("cem-1", "first-order")]
    first, second = recordings
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first.overhead.rgb, second.overhead.rgb)
    assert first.trace.steps[0].pose == second.trace.steps[0].pose
    assert first.trace.steps[0].score == second.trace.steps[0].score
    assert first.trace.steps[1].pose != second.trace.steps[1].pose


def test_a_confident_network_grasps_at_once() -> None:
    station = SimStation(SimConfig(objects="blocks-test"))
    try:
        sure = FunctionScorer(lambda inputs: torch.ones(len(inputs)))
        trial, recording = run_trial(station, sure, "cem-1", 1, seed=4, settings=ServoSettings())
        blind, _ = run_trial(station, None, "random", 1, seed=4, settings=ServoSettings())
    finally:
        station.close()
    assert recording is not None
    assert recording.trace.confident
    assert (trial.moves, trial.success) == (0, blind.success)
    assert trial.truth_held == blind.truth_held


def test_a_trial_to_record_that_is_aborted_says_why(factory: TrialContextFactory) -> None:
    hasty = SimStationFactory(config=SimConfig(objects="blocks-test", settle_limit_s=0.02))
    with pytest.raises(TrialAbortedError, match="trial 0 of seed 4 was aborted: settle: objects still moved"):
        record_trial(replace(factory, open_station=hasty), "cem-1", 0, seed=4, servo=ServoSettings())


def test_a_run_that_is_replaced_between_trials_is_noticed(factory: TrialContextFactory) -> None:
    with pytest.raises(CheckpointError, match="holds another network"):
        replace(factory, weights_sha256="0" * 64)()


def test_whoever_watches_is_there_first_and_closed_where_no_trial_can_begin(factory: TrialContextFactory) -> None:
    closed: list[str] = []

    class Watcher:
        def begin(self, start: TrialStart) -> None: ...
        def step(self, step: ServoStep) -> None: ...
        def end(self, recording: TrialRecording | None) -> None: ...

        def close(self) -> None:
            closed.append("closed")

    with pytest.raises(CheckpointError, match="holds another network"):
        replace(factory, weights_sha256="0" * 64, watch=Watcher)()
    assert closed == ["closed"]
