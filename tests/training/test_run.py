"""Runs on disk: what they hold, what is noticed when they are read, and how one takes the place of another."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from tests.support.drawn import SMALL, drawn_inputs

from handsight.servoing.homography import InputGrid
from handsight.training.errors import CheckpointError
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.run import DataOrigin, load_run, load_scorer, save_run
from handsight.training.run_folder import RUN_RECORD, WEIGHTS
from handsight.training.trainer import train

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
