"""Runs on disk: what they hold, what is noticed when they are read, and how one takes the place of another."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from tests.support.drawn import SMALL, drawn_inputs
from tests.support.networks import trained_looking
from tests.support.run_mutations import mutate_run
from torch.nn import functional

from handsight.servoing.homography import InputGrid
from handsight.training.errors import CheckpointError, NetworkSettingsError
from handsight.training.gqn import CHANNEL_SETS, GqnConfig, GraspQualityNetwork
from handsight.training.precision import Precision
from handsight.training.run import DataOrigin, load_run, load_scorer, save_run
from handsight.training.run_files import check_files
from handsight.training.run_folder import CARD, NEXT_WEIGHTS, RUN_RECORD, WEIGHTS
from handsight.training.run_record import (
    CHANNEL_NAMES,
    PRECISION_NAMES,
    RECORD_SHA256,
    TWINS_TOGETHER,
    WEIGHTS_SHA256,
    read_values,
)
from handsight.training.trainer import train

ORIGIN = DataOrigin(dataset="grasps@v1", ref="v1", snapshot="ABC", digest="d" * 64, view="overhead", attempts=80)


@pytest.fixture
def run_folder(tmp_path: Path) -> Path:
    trained = train(drawn_inputs(80, seed=0), replace(SMALL, epochs=1))
    folder = tmp_path / "run"
    save_run(
        folder,
        trained.network,
        origins=[ORIGIN],
        grid=InputGrid(crop_px=100, size_px=16),
        settings=replace(SMALL, epochs=1),
        history=trained.history,
        kept_epoch=trained.kept.number,
    )
    return folder


def test_a_run_names_its_data_and_scores_as_before(run_folder: Path) -> None:
    network = train(drawn_inputs(80, seed=0), replace(SMALL, epochs=1)).network
    run = load_run(run_folder)
    assert run.origins == (ORIGIN,)
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
SHAPE = GqnConfig(channels="rgb", widths=(8, 8), kernels=(3, 5), dense=(16,), size_px=16, padded=True)
"""Of the stored record. It does not name padding: when it was written, every network had it."""


def test_a_stored_record_is_read_and_one_written_now_has_the_same_keys(tmp_path: Path, run_folder: Path) -> None:
    save_file(GraspQualityNetwork(SHAPE).state_dict(), tmp_path / WEIGHTS)
    (tmp_path / RUN_RECORD).write_text(json.dumps(STORED))
    run = load_run(tmp_path)
    assert run.network.config == SHAPE
    assert run.origins == (replace(ORIGIN, digest="d00f", view="pregrasp"),)
    assert run.grid == InputGrid(crop_px=100, size_px=16)
    assert run.record == STORED

    def keys(value: object) -> dict[str, object] | None:
        return {name: keys(part) for name, part in value.items()} if isinstance(value, dict) else None

    written = json.loads((run_folder / RUN_RECORD).read_text())
    hashes = dict.fromkeys((WEIGHTS_SHA256, RECORD_SHA256))
    expected = keys(STORED) or {}
    del expected["origin"]
    expected["settings"]["network"] |= {"padded": None}  # type: ignore[index]
    expected["settings"] |= dict.fromkeys(("least_epochs", "patience", "warmup_steps", "average", "mixup", "precision"))  # type: ignore[operator]
    expected["settings"]["jitter"] |= {"flips": None}  # type: ignore[index]
    assert keys(written) == {**expected, "origins": None, TWINS_TOGETHER: None, "kept_epoch": None, **hashes}
    assert [list(origin) for origin in written["origins"]] == [list(STORED["origin"])]
    assert list(written["history"][0]) == list(STORED["history"][0])
    assert written["kept_epoch"] == 1


def test_a_run_names_every_version_and_picture_that_it_was_trained_on(run_folder: Path) -> None:
    origins = (ORIGIN, replace(ORIGIN, view="pregrasp", attempts=60), replace(ORIGIN, dataset="s3://lab/more", ref="x"))
    run = load_run(run_folder)
    grid, settings = InputGrid(size_px=16), replace(SMALL, epochs=1)
    save_run(run_folder, run.network, origins=origins, grid=grid, settings=settings, overwrite=True)
    assert load_run(run_folder).origins == origins
    with pytest.raises(ValueError, match="there is no origin"):
        save_run(run_folder, run.network, origins=[], grid=grid, settings=settings, overwrite=True)
    assert load_run(run_folder).origins == origins


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"origins": []}, "origins has 0 entries, expected 1 to 1000"),
        ({"origins": None}, "origins is None, expected a list"),
        ({"origins": [{**ORIGIN.to_json(), "share": 1}]}, r"origins\[0\].'share' is no setting that is known"),
        ({"origin": ORIGIN.to_json()}, "there is 'origin' in run version 2, expected 'origins'"),
        ({"run_version": 1}, "origin is missing; there is 'origins' in run version 1, expected 'origin'"),
    ],
)
def test_where_the_data_are_named_follows_from_the_version(
    run_folder: Path, changes: dict[str, Any], fault: str
) -> None:
    record = json.loads((run_folder / RUN_RECORD).read_text())
    (run_folder / RUN_RECORD).write_text(json.dumps({**record, **changes}))
    with pytest.raises(CheckpointError, match=fault):
        load_run(run_folder)


def test_a_run_from_before_there_was_a_choice_of_padding_scores_as_it_did(tmp_path: Path) -> None:
    """The layers are written out here as they were then."""
    network = trained_looking(SHAPE)
    save_file(network.state_dict(), tmp_path / WEIGHTS)
    (tmp_path / RUN_RECORD).write_text(json.dumps(STORED))
    inputs = torch.rand(4, 4, 16, 16, generator=torch.Generator().manual_seed(0))
    x, weights = (inputs[:, :3] - 0.5) / 0.25, network.state_dict()
    for at, kernel in ((0, 3), (3, 5)):
        x = functional.conv2d(x, weights[f"features.{at}.weight"], stride=2, padding=kernel // 2)
        statistics = [
            weights[f"features.{at + 1}.{name}"] for name in ("running_mean", "running_var", "weight", "bias")
        ]
        x = functional.elu(functional.batch_norm(x, *statistics))
    x = functional.selu(functional.linear(x.flatten(1), weights["head.1.weight"], weights["head.1.bias"]))
    expected = torch.sigmoid(functional.linear(x, weights["head.3.weight"], weights["head.3.bias"]))[:, 0]
    torch.testing.assert_close(load_scorer(tmp_path)(inputs), expected, atol=1e-6, rtol=0)
    coarse = load_scorer(tmp_path, precision="bfloat16")(inputs)
    assert 0 < (coarse - expected).abs().max() < 0.02


@pytest.mark.parametrize("config", [GqnConfig(), SHAPE], ids=["default", "other"])
def test_a_network_s_shape_comes_back_from_json(config: GqnConfig) -> None:
    assert GqnConfig.from_json(json.loads(json.dumps(config.to_json()))) == config


def test_names_that_a_record_may_hold_are_those_there_are() -> None:
    """They stand in run_record.py as text, because a list of runs needs no PyTorch."""
    assert tuple(CHANNEL_SETS) == CHANNEL_NAMES
    assert get_args(Precision) == PRECISION_NAMES


def test_a_record_is_read_alike_with_its_network_and_without(run_folder: Path) -> None:
    assert read_values(run_folder / RUN_RECORD) == load_run(run_folder).record
    edit_record(run_folder, grid__size_px=8)
    with pytest.raises(CheckpointError, match=r"grid.size_px is 8, expected 16.*; its values are not those"):
        read_values(run_folder / RUN_RECORD)


def edit_record(folder: Path, **changes: Any) -> None:
    """Change a run's record as with an editor; a key with dots lies deeper, and None removes it."""
    record = json.loads((folder / RUN_RECORD).read_text())
    for name, value in changes.items():
        *parents, last = name.split("__")
        holder = record
        for parent in parents:
            holder = holder[int(parent) if isinstance(holder, list) else parent]
        if value is None:
            del holder[last]
        else:
            holder[last] = value
    (folder / RUN_RECORD).write_text(json.dumps(record))


def test_a_flipped_bit_in_the_weights_is_noticed(run_folder: Path) -> None:
    data = (run_folder / WEIGHTS).read_bytes()
    rng = np.random.default_rng(0)
    for at in rng.integers(len(data), size=80):
        spoilt = bytearray(data)
        spoilt[at] ^= 1 << int(rng.integers(8))
        (run_folder / WEIGHTS).write_bytes(spoilt)
        with pytest.raises(CheckpointError, match=r"model.safetensors is damaged \(its SHA-256 is"):
            load_run(run_folder)
    (run_folder / WEIGHTS).write_bytes(data)
    assert load_run(run_folder).weights_sha256 == hashlib.sha256(data).hexdigest()


def test_weights_of_another_run_are_refused_by_name(run_folder: Path) -> None:
    """Where the record names its weights by hash, and where it was written before it did."""
    config = replace(SMALL.network, channels="rgb", dense=(8,))
    save_file(GraspQualityNetwork(config).state_dict(), run_folder / WEIGHTS)
    for change in ({}, {WEIGHTS_SHA256: None, RECORD_SHA256: None}):
        edit_record(run_folder, **change)
        with pytest.raises(CheckpointError) as caught:
            load_run(run_folder)
        for part in ("features.0.weight is torch.float32 (8, 3, 3, 3), expected torch.float32 (8, 4, 3, 3)", "head.1"):
            assert part in str(caught.value)
    assert "SHA-256" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"grid__crop_px": 99}, "its values are not those that were written"),
        ({"origins__0__digest": "e" * 64}, "its values are not those that were written"),
        ({"grid__size_px": 8}, "grid.size_px is 8, expected 16"),
        ({"grid__crop_px": 10**9}, "crop"),
        ({"settings__network__size_px": 16 * 10**9}, "settings.network.size_px is 16000000000"),
        ({"settings__network__size_px": 2**30}, "size_px is 1073741824, expected a whole number of 1 to 512"),
        ({"settings__network__widths": [10**9, 10**9]}, "widths are"),
        ({"settings__network__dense": [2**31] * 3}, "dense are"),
        ({"settings__network__dense": [4096] * 8}, "parameters, expected at most"),
        ({"settings__network__kernels": [3] * 100_000}, "100000 kernels"),
        ({"settings__network__size_px": "16"}, "settings.network.size_px is '16'"),
        ({"settings__network__channels": ["rgb"]}, "settings.network.channels is"),
        ({"settings__network__depth": 3}, "settings.network.'depth' is no setting"),
        ({"settings__seed": 1.5}, "settings.seed is 1.5"),
        ({"history": [{"number": 1}]}, r"history\[0\].train_loss is missing"),
        ({"origins__0__view": "sideways"}, r"origins\[0\].view is 'sideways', expected one of"),
        ({"run_version": True}, "run_version is True"),
        ({"weights_sha256": "abc"}, "weights_sha256 is 'abc', expected 64"),
    ],
)
def test_a_record_that_no_run_can_have_is_refused(run_folder: Path, changes: dict[str, Any], fault: str) -> None:
    edit_record(run_folder, **changes)
    with pytest.raises(CheckpointError, match=fault):
        load_run(run_folder)


def test_everything_wrong_with_a_record_is_said_at_once(run_folder: Path) -> None:
    edit_record(run_folder, origins__0__attempts=-1, grid__size_px=None, settings__network__channels="rgbx", history={})
    with pytest.raises(CheckpointError) as caught:
        load_run(run_folder)
    for part in ("origins[0].attempts is -1", "grid.size_px is missing", "channels is 'rgbx'", "history is {}"):
        assert part in str(caught.value)


@pytest.mark.parametrize("text", ["[" * 100_000, '{"run_version": NaN}', "9" * 5000, "\0", "null", "{}"])
def test_a_record_that_is_none_is_refused(run_folder: Path, text: str) -> None:
    (run_folder / RUN_RECORD).write_text(text)
    with pytest.raises(CheckpointError, match=r"run\.json is damaged"):
        load_run(run_folder)


def test_weights_that_are_no_numbers_are_refused_without_a_hash_too(run_folder: Path) -> None:
    tensors = load_run(run_folder).network.state_dict()
    tensors["head.1.bias"][0] = torch.nan
    save_file(tensors, run_folder / WEIGHTS)
    edit_record(run_folder, weights_sha256=None)
    with pytest.raises(CheckpointError, match=r"head\.1\.bias holds numbers that are none"):
        load_run(run_folder)


def test_files_that_are_far_too_large_are_not_read(run_folder: Path) -> None:
    with (run_folder / WEIGHTS).open("r+b") as file:
        file.truncate(1 << 40)
    with pytest.raises(CheckpointError, match="1099511627776 bytes, expected at most"):
        load_run(run_folder)
    with (run_folder / RUN_RECORD).open("r+b") as file:
        file.truncate(1 << 40)
    with pytest.raises(CheckpointError, match=r"run.json is damaged \(it has 1099511627776 bytes"):
        load_run(run_folder)


@pytest.mark.parametrize("start", range(0, 200, 50))
def test_a_damaged_run_is_refused_or_scores_as_before(run_folder: Path, tmp_path: Path, start: int) -> None:
    """Without hashes, as in an older run, damage to the numbers themselves cannot be told; all else can."""
    whole = load_run(run_folder)
    inputs = torch.from_numpy(drawn_inputs(3, seed=5).inputs).float()
    expected = whole.scorer()(inputs)
    for seed in range(start, start + 50):
        folder = tmp_path / str(seed)
        shutil.copytree(run_folder, folder)
        what, unsealed = mutate_run(folder, np.random.default_rng([1, seed]))
        message = ""
        try:
            run = load_run(folder)
        except CheckpointError as error:
            message = str(error)
        else:
            same = run.grid == whole.grid and torch.equal(run.scorer()(inputs), expected)
            assert same or unsealed, what
        assert "\n" not in message, what
        assert len(message) < 2000, what


def save_another(folder: Path, *, overwrite: bool = True) -> None:
    trained = train(drawn_inputs(80, seed=3), replace(SMALL, epochs=1, seed=5))
    settings = replace(SMALL, epochs=1, seed=5)
    grid = InputGrid(crop_px=90, size_px=16)
    save_run(folder, trained.network, origins=[ORIGIN], grid=grid, settings=settings, overwrite=overwrite)


def test_a_run_is_replaced_only_where_that_was_asked_for(run_folder: Path) -> None:
    before = {path.name: path.read_bytes() for path in run_folder.iterdir()}
    assert set(before) == {RUN_RECORD, WEIGHTS, CARD}
    with pytest.raises(CheckpointError, match=r"holds a run already.*--overwrite"):
        save_another(run_folder, overwrite=False)
    assert {path.name: path.read_bytes() for path in run_folder.iterdir()} == before
    save_another(run_folder)
    assert load_run(run_folder).grid.crop_px == 90
    assert {path.name for path in run_folder.iterdir()} == set(before)


@pytest.mark.parametrize("steps", range(5))
def test_a_run_that_is_being_replaced_is_at_any_moment_the_old_one_or_the_new_one(
    run_folder: Path, monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    """Every step ends in a rename; the process dies instead of the one after some of them."""
    old = load_run(run_folder).weights_sha256
    replace_file, done = Path.replace, 0

    def dies(path: Path, target: Path) -> Path:
        nonlocal done
        if done == steps:
            raise KeyboardInterrupt
        done += 1
        return replace_file(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", dies)
        if steps < 4:
            with pytest.raises(KeyboardInterrupt):
                save_another(run_folder)
        else:
            save_another(run_folder)
    assert done == steps
    run = load_run(run_folder)
    assert (run.weights_sha256 == old, run.grid.crop_px) == ((True, 100) if steps < 2 else (False, 90))
    # A card is about the run that is there, or is not there.
    assert check_files(run_folder, run.record).card == ("current" if steps in (0, 4) else "missing")
    (run_folder / ".run.unfinished-0123.json").write_text("left by a kill")
    (run_folder / ".README.unfinished-0123.md").write_text("left by a kill")
    save_another(run_folder)
    assert {path.name for path in run_folder.iterdir()} == {RUN_RECORD, WEIGHTS, CARD}
    assert not (run_folder / NEXT_WEIGHTS).exists()


@pytest.mark.parametrize("steps", range(4))
def test_a_run_that_is_saved_where_none_was_has_its_card_from_the_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    replace_file, done = Path.replace, 0

    def dies(path: Path, target: Path) -> Path:
        nonlocal done
        if done == steps:
            raise KeyboardInterrupt
        done += 1
        return replace_file(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", dies)
        with pytest.raises(KeyboardInterrupt):
            save_another(tmp_path / "run", overwrite=False)
    assert (tmp_path / "run" / RUN_RECORD).exists() == (steps == 3)
    if steps == 3:
        assert check_files(tmp_path / "run", load_run(tmp_path / "run").record).card == "current"
    else:
        save_another(tmp_path / "run", overwrite=False)
        assert {path.name for path in (tmp_path / "run").iterdir()} == {RUN_RECORD, WEIGHTS, CARD}


def test_the_network_and_its_settings_agree_when_a_run_is_saved(tmp_path: Path) -> None:
    network = GraspQualityNetwork(SMALL.network)
    with pytest.raises(NetworkSettingsError, match="expected that they agree"):
        save_run(tmp_path / "run", network, origins=[ORIGIN], grid=InputGrid(), settings=SMALL)
    assert not (tmp_path / "run").exists()


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
    trained = train(drawn_inputs(40, seed=0), replace(SMALL, epochs=1))
    with pytest.raises(CheckpointError, match="holds other files"):
        save_run(tmp_path, trained.network, origins=[ORIGIN], grid=InputGrid(), settings=SMALL)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
