"""Training on drawn inputs whose rule is known, and runs on disk."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from tests.support.drawn import SMALL, drawn_inputs

from handsight.datasets.inputs.augmentation import Jitter
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.servoing.homography import InputGrid
from handsight.training.errors import CheckpointError, TrainerSettingsError, TrainingDataError
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
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


def test_scores_with_flips_are_the_mean_over_the_flips_of_each_input() -> None:
    data = drawn_inputs(50, seed=0)
    network, _ = train(data, replace(SMALL, epochs=1))
    rows = torch.tensor([3, 40, 8])
    turned = [data.inputs[rows.numpy()][..., ::down, ::across] for down in (1, -1) for across in (1, -1)]
    expected = np.mean([predict(network, inputs.copy(), torch.arange(3)) for inputs in turned], axis=0)
    np.testing.assert_allclose(predict_with_flips(network, data.inputs, rows), expected, atol=1e-6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched(Jitter):
    """Varies nothing and keeps every batch it is given."""

    batches: list[torch.Tensor] = field(default_factory=list)

    def __call__(self, inputs: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        self.batches.append(inputs)
        return inputs


def passes_of(data: GraspInputs, settings: TrainSettings) -> list[list[bytes]]:
    """The inputs that the network learnt from, pass by pass, in their order."""
    watched = Watched()
    train(data, replace(settings, jitter=watched))
    inputs = [one.numpy().tobytes() for batch in watched.batches for one in batch]
    size = len(inputs) // settings.epochs
    return [inputs[start : start + size] for start in range(0, len(inputs), size)]


def test_every_pass_sees_every_attempt_in_all_flips_once_and_in_an_order_of_its_own() -> None:
    data, settings = drawn_inputs(30, seed=0), replace(SMALL, epochs=2, holdout=0)
    inputs = data.inputs.astype(np.float32)
    flips = [inputs[..., ::down, ::across] for down in (1, -1) for across in (1, -1)]
    expected = sorted(one.tobytes() for flip in flips for one in flip)
    first, second = passes_of(data, settings)
    assert sorted(first) == sorted(second) == expected
    assert first != second
    assert passes_of(data, settings) == [first, second]
    assert passes_of(data, replace(settings, seed=7))[0] != first


def test_a_batch_of_one_is_left_out() -> None:
    """Over one input of which one pixel is left, batch normalisation has no variance, and torch refuses."""
    data = drawn_inputs(10, seed=0)
    small = GraspInputs(inputs=data.inputs[:, :, 6:10, 6:10].copy(), attempts=data.attempts)
    settings = replace(SMALL, network=replace(SMALL.network, size_px=4), epochs=1, holdout=0, batch=13)
    (seen,) = passes_of(small, settings)
    assert len(seen) == 39


@pytest.mark.parametrize("seed", [-1, 2**40])
def test_any_seed_that_torch_takes_will_do(seed: int) -> None:
    _, history = train(drawn_inputs(20, seed=0), replace(SMALL, epochs=1, seed=seed))
    assert np.isfinite(history[0].train_loss)


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


# As written by run version 1; files of this shape lie in users' folders.
STORED = json.loads("""
{
  "run_version": 1,
  "handsight": "0.1.0",
  "created": "2026-03-01T12:00:00+00:00",
  "origin": {
    "dataset": "grasps@v1", "ref": "v1", "snapshot": "ABC", "digest": "d00f", "view": "pregrasp", "attempts": 80
  },
  "grid": {"crop_px": 100, "size_px": 16},
  "settings": {
    "network": {"channels": "rgb", "widths": [8, 8], "kernels": [3, 5], "dense": [16], "size_px": 16},
    "epochs": 1, "batch": 32, "learning_rate": 0.002, "weight_decay": 0.01, "balance": false, "holdout": 0.25,
    "jitter": {
      "brightness": 0.2, "colour_noise": 0.02, "height_noise_m": 0.001, "turn_rad": 0.17, "shift": 0.0234375
    },
    "seed": 1
  },
  "parameters": 0,
  "history": [
    {"number": 1, "train_loss": 0.7, "held_out": {"attempts": 0, "accuracy": null, "auc": null, "loss": null}}
  ]
}
""")
SHAPE = GqnConfig(channels="rgb", widths=(8, 8), kernels=(3, 5), dense=(16,), size_px=16)


def test_a_stored_record_is_read_and_one_written_now_has_the_same_keys(tmp_path: Path, run_folder: Path) -> None:
    save_file(GraspQualityNetwork(SHAPE).state_dict(), tmp_path / WEIGHTS)
    (tmp_path / RUN_RECORD).write_text(json.dumps(STORED))
    run = load_run(tmp_path)
    assert run.network.config == SHAPE
    assert run.origin == replace(ORIGIN, digest="d00f", view="pregrasp")
    assert run.grid == InputGrid(crop_px=100, size_px=16)
    assert run.record == STORED

    def keys(value: object) -> object:
        return {name: keys(part) for name, part in value.items()} if isinstance(value, dict) else None

    written = json.loads((run_folder / RUN_RECORD).read_text())
    assert keys(written) == keys(STORED)
    assert list(written["history"][0]) == list(STORED["history"][0])


@pytest.mark.parametrize("config", [GqnConfig(), SHAPE], ids=["default", "other"])
def test_a_network_s_shape_comes_back_from_json(config: GqnConfig) -> None:
    assert GqnConfig.from_json(json.loads(json.dumps(config.to_json()))) == config


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
