"""Training on drawn inputs whose rule is known, and runs on disk."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.support.drawn import SMALL, drawn_inputs

from handsight.datasets.inputs.materialize import GraspInputs
from handsight.servoing.homography import InputGrid
from handsight.training.errors import CheckpointError, TrainerSettingsError, TrainingDataError
from handsight.training.run import WEIGHTS, DataOrigin, load_run, load_scorer, save_run
from handsight.training.run_folder import RUN_RECORD
from handsight.training.trainer import TrainSettings, predict, predict_with_flips, train


def test_training_learns_the_rule_and_it_carries_over() -> None:
    network, history = train(drawn_inputs(300, seed=0), SMALL)
    assert history[-1].train_loss < 0.5 * history[0].train_loss
    assert history[-1].held_out.attempts == 75
    assert (history[-1].held_out.auc or 0) > 0.95
    fresh = drawn_inputs(100, seed=9)
    scores = predict(network, fresh.inputs, torch.arange(100))
    assert scores[fresh.labels == 1].mean() > scores[fresh.labels == 0].mean() + 0.4


def test_equal_seeds_give_equal_weights_and_leave_torch_alone() -> None:
    data, quick = drawn_inputs(80, seed=0), replace(SMALL, epochs=2)
    torch.manual_seed(3)
    expected_draw = torch.rand(1)
    torch.manual_seed(3)
    first = train(data, quick)[0].state_dict()
    assert torch.equal(torch.rand(1), expected_draw)
    second = train(data, quick)[0].state_dict()
    other = train(data, replace(quick, seed=2))[0].state_dict()
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert not all(torch.equal(first[name], other[name]) for name in first)


def test_mirrored_scores_are_the_mean_over_the_mirrorings_of_each_input() -> None:
    data = drawn_inputs(50, seed=0)
    network, _ = train(data, replace(SMALL, epochs=1))
    rows = torch.tensor([3, 40, 8])
    turned = [data.inputs[rows.numpy()][..., ::down, ::across] for down in (1, -1) for across in (1, -1)]
    expected = np.mean([predict(network, inputs.copy(), torch.arange(3)) for inputs in turned], axis=0)
    np.testing.assert_allclose(predict_with_flips(network, data.inputs, rows), expected, atol=1e-6)


def test_one_class_alone_teaches_nothing() -> None:
    data = drawn_inputs(20, seed=0)
    same = GraspInputs(inputs=data.inputs, attempts=data.attempts.assign(success=False))
    with pytest.raises(TrainingDataError, match="0 of 20"):
        train(same, SMALL)


def test_bad_settings_report_every_fault() -> None:
    with pytest.raises(TrainerSettingsError) as caught:
        TrainSettings(epochs=0, batch=1, learning_rate=-1, holdout=1.0)
    for part in ("0 epochs", "learning rate is -1", "holdout is 1.0"):
        assert part in str(caught.value)


ORIGIN = DataOrigin(dataset="grasps@v1", ref="v1", snapshot="ABC", digest="d" * 64, view="overhead", attempts=80)


@pytest.fixture
def run_folder(tmp_path: Path) -> Path:
    network, history = train(drawn_inputs(80, seed=0), replace(SMALL, epochs=1))
    folder = tmp_path / "run"
    save_run(
        folder,
        network,
        origin=ORIGIN,
        grid=InputGrid(crop_px=100, size_px=16),
        settings=replace(SMALL, epochs=1),
        history=history,
    )
    return folder


def test_a_run_names_its_data_and_scores_as_before(run_folder: Path) -> None:
    network, _ = train(drawn_inputs(80, seed=0), replace(SMALL, epochs=1))
    run = load_run(run_folder)
    assert run.origin == ORIGIN
    assert run.grid == InputGrid(crop_px=100, size_px=16)
    inputs = torch.from_numpy(drawn_inputs(10, seed=5).inputs).float()
    torch.testing.assert_close(load_scorer(run_folder)(inputs), torch.sigmoid(network(inputs)).detach())


def test_folders_that_hold_no_run_are_refused(run_folder: Path, tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="is no folder"):
        load_run(tmp_path / "nothing")
    with pytest.raises(CheckpointError, match="holds no finished run"):
        load_run(tmp_path)
    record = json.loads((run_folder / RUN_RECORD).read_text())
    (run_folder / RUN_RECORD).write_text(json.dumps({**record, "run_version": 99}))
    with pytest.raises(CheckpointError, match="newer handsight"):
        load_run(run_folder)


@pytest.mark.parametrize("damage", ["record", "weights", "missing weights"])
def test_damaged_runs_say_so(run_folder: Path, damage: str) -> None:
    if damage == "record":
        (run_folder / RUN_RECORD).write_text("{")
    elif damage == "weights":
        (run_folder / WEIGHTS).write_bytes(b"\0" * 40)
    else:
        (run_folder / WEIGHTS).unlink()
    with pytest.raises(CheckpointError, match="damaged"):
        load_run(run_folder)


def test_a_run_never_overwrites_other_things(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    network, history = train(drawn_inputs(40, seed=0), replace(SMALL, epochs=1))
    with pytest.raises(CheckpointError, match="holds other files"):
        save_run(tmp_path, network, origin=ORIGIN, grid=InputGrid(), settings=SMALL, history=history)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
