"""Predicted against happened: scores of executed grasps are those that a network gives their training inputs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from tests.support.factories import make_attempt, make_header, record
from tests.support.networks import trained_looking
from tests.support.runs import save_untrained

from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.datasets.inputs.materialize import materialize
from handsight.evaluation.foresight import (
    Foresight,
    calibrate,
    foresights,
    learnt_from,
    most_wrong,
    reliability_rows,
    scores_at_grasps,
)
from handsight.evaluation.temperature import Temperature
from handsight.servoing.homography import InputGrid
from handsight.training.gqn import GqnConfig
from handsight.training.prediction import predict
from handsight.training.run import load_run
from handsight.training.scorer import Scorer

OUTCOMES = (Outcome.HELD, Outcome.EMPTY, Outcome.ABORTED, Outcome.EMPTY)
CONFIG = GqnConfig(widths=(8, 8), kernels=(3, 3), dense=(16,), size_px=16)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    path = tmp_path_factory.mktemp("foresight") / "grasps"
    repository = GraspRepository.create(path)
    header = make_header(width=16, height=12)
    record(repository, header, [make_attempt(header, number, outcome=OUTCOMES[number % 4]) for number in range(12)])
    return GraspDataset.open(str(path))


def test_scores_are_those_of_the_inputs_that_training_makes(dataset: GraspDataset) -> None:
    grid, network = InputGrid(size_px=16), trained_looking(CONFIG)
    data = materialize(dataset, grid=grid)
    ids = [str(key) for key in data.attempts.index][::-1]
    scores = scores_at_grasps(Scorer(network, grid), dataset, ids)
    expected = predict(network, data.inputs, torch.arange(len(ids)).flip(0))
    np.testing.assert_allclose(scores, expected, atol=1e-4)
    assert np.ptp(scores) > 0.01


def test_labels_stand_beside_scores_and_what_has_none_is_left_out(dataset: GraspDataset) -> None:
    ids = [str(key) for key in dataset.attempts.index]
    raw = np.linspace(0, 1, len(ids)).astype(np.float32)
    softer = Temperature(value=3.0, attempts=20, source="x")
    seen = foresights(dataset, ids, raw, softer)
    assert [one.attempt for one in seen] == [key for number, key in enumerate(ids) if number % 4 != 2]
    assert [one.held for one in seen] == [number % 4 == 0 for number in range(12) if number % 4 != 2]
    expected = softer(np.array([one.raw for one in seen], np.float32))
    np.testing.assert_allclose(np.array([one.score for one in seen]), expected, rtol=1e-6)


def test_the_most_wrong_come_first() -> None:
    def seen(attempt: str, held: bool, score: float) -> Foresight:
        return Foresight(attempt=attempt, target="", held=held, raw=score, score=score)

    ordered = most_wrong([seen("a", True, 0.9), seen("b", False, 0.8), seen("c", True, 0.1), seen("d", False, 0.05)])
    assert [one.attempt for one in ordered] == ["c", "b", "a", "d"]
    assert ordered[0].surprise == pytest.approx(0.9)


def test_rates_are_of_the_attempts_in_each_bin() -> None:
    scores = [0.0, 0.05, 0.35, 0.39, 1.0, 0.95]
    held = [False, True, True, False, True, True]
    seen = [
        Foresight(attempt=str(at), target="", held=one, raw=score, score=score)
        for at, (score, one) in enumerate(zip(scores, held, strict=True))
    ]
    rows = reliability_rows(seen)
    assert [(round(row["low"], 1), row["attempts"], row["held"]) for row in rows] == [
        (0.0, 2, 1),
        (0.3, 2, 1),
        (0.9, 2, 2),
    ]
    assert all(row["ci95"][0] <= row["rate"] <= row["ci95"][1] for row in rows)


def test_a_run_of_other_data_is_not_calibrated_and_says_why(dataset: GraspDataset, tmp_path: Path) -> None:
    save_untrained(tmp_path / "run")
    run = load_run(tmp_path / "run")
    temperature = calibrate(run, dataset)
    assert not temperature.fitted
    assert "cannot be read again" in str(temperature)
    assert learnt_from(run, dataset) is None
