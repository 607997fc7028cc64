from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from tests.support.drawn import SMALL, drawn_inputs

from handsight.datasets.inputs.mixture import LabelledInputs
from handsight.training.course import Epoch
from handsight.training.errors import CheckpointError
from handsight.training.settings import TrainSettings
from handsight.training.trainer import Trained, train

RECIPE = replace(SMALL, epochs=6, least_epochs=2, patience=2)


class PulledPlugError(Exception):
    """Stands for the end of a process."""


def interrupted(data: LabelledInputs, recipe: TrainSettings, path: Path, *, after: int) -> None:
    """Train into a checkpoint and stop after a pass."""

    def stop(epoch: Epoch) -> None:
        if epoch.number == after:
            raise PulledPlugError

    with pytest.raises(PulledPlugError):
        train(data, recipe, checkpoint=path, on_epoch=stop)


def assert_same(one: Trained, other: Trained) -> None:
    assert one.history == other.history
    assert one.kept == other.kept
    for name, tensor in one.network.state_dict().items():
        assert torch.equal(tensor, other.network.state_dict()[name]), name


@pytest.mark.parametrize("after", [1, 3, 6])
def test_what_goes_on_from_a_checkpoint_ends_as_if_it_had_never_stopped(tmp_path: Path, after: int) -> None:
    data, path, recipe = drawn_inputs(90, seed=0), tmp_path / "checkpoint.ckpt", replace(RECIPE, patience=6)
    interrupted(data, recipe, path, after=after)
    told: list[int] = []
    resumed = train(data, recipe, checkpoint=path, on_epoch=lambda epoch: told.append(epoch.number))
    assert_same(resumed, train(data, recipe))
    assert told == [1, 2, 3, 4, 5, 6]


def test_a_training_that_is_stopped_again_and_again_ends_the_same(tmp_path: Path) -> None:
    data, path = drawn_inputs(90, seed=3), tmp_path / "checkpoint.ckpt"
    whole = train(data, RECIPE)
    for after in range(1, len(whole.history) + 1):
        interrupted(data, RECIPE, path, after=after)
    assert_same(train(data, RECIPE, checkpoint=path), whole)


@pytest.mark.parametrize(
    "other",
    [replace(RECIPE, seed=2), replace(RECIPE, learning_rate=1e-3), replace(RECIPE, epochs=9)],
    ids=["seed", "rate", "passes"],
)
def test_a_checkpoint_of_another_recipe_is_refused(tmp_path: Path, other: TrainSettings) -> None:
    data, path = drawn_inputs(60, seed=0), tmp_path / "checkpoint.ckpt"
    interrupted(data, RECIPE, path, after=1)
    before = path.read_bytes()
    with pytest.raises(CheckpointError, match="another recipe"):
        train(data, other, checkpoint=path)
    assert path.read_bytes() == before


def test_a_checkpoint_of_other_data_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.ckpt"
    interrupted(drawn_inputs(60, seed=0), RECIPE, path, after=1)
    with pytest.raises(CheckpointError, match="other data"):
        train(drawn_inputs(60, seed=1), RECIPE, checkpoint=path)


@pytest.mark.parametrize("damage", ["flipped", "short", "empty", "text"])
def test_a_damaged_checkpoint_is_refused(tmp_path: Path, damage: str) -> None:
    data, path = drawn_inputs(60, seed=0), tmp_path / "checkpoint.ckpt"
    interrupted(data, RECIPE, path, after=1)
    content = bytearray(path.read_bytes())
    if damage == "flipped":
        content[len(content) // 2] ^= 1
    damaged = {"flipped": bytes(content), "short": bytes(content[:-9]), "empty": b"", "text": b"x" * 100}[damage]
    path.write_bytes(damaged)
    with pytest.raises(CheckpointError, match=r"checkpoint.ckpt is damaged \(.*delete it to train from the beginning"):
        train(data, RECIPE, checkpoint=path)
