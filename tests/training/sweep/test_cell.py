from __future__ import annotations

import json
from dataclasses import asdict, replace

import pytest

from handsight.training.errors import SweepPlanError
from handsight.training.settings import TrainSettings
from handsight.training.sweep.cell import NO_JITTER, VARIED, Cell, axis_faults, varied_setting

CELL = Cell(dataset=0, channels="rgb", size=500, trial=3)


def test_cells_have_names_of_their_own() -> None:
    cells = [
        CELL,
        replace(CELL, size=None),
        replace(CELL, trial=30),
        replace(CELL, dataset=1),
        replace(CELL, varied=(("mixup", "0.2"),)),
        replace(CELL, varied=(("mixup", "0"), ("balance", "on"))),
    ]
    assert [cell.name for cell in cells] == [
        "rgb-500-003",
        "rgb-all-003",
        "rgb-500-030",
        "rgb-500-003-data=1",
        "rgb-500-003-mixup=0.2",
        "rgb-500-003-mixup=0-balance=on",
    ]
    assert cells[5].series() == "rgb mixup=0 balance=on"
    for cell in cells:
        assert Cell.from_json(json.loads(json.dumps(asdict(cell)))) == cell


def test_what_is_varied_reaches_the_recipe() -> None:
    varied = (("augmentation", "off"), ("balance", "on"), ("lr", "0.01"), ("batch", "50"), ("mixup", "0"))
    settings = replace(CELL, varied=varied).settings(TrainSettings(), 7)
    assert settings.network.channels == "rgb"
    assert (settings.jitter, settings.balance, settings.learning_rate) == (NO_JITTER, True, 0.01)
    assert (settings.batch, settings.mixup, settings.seed) == (50, 0.0, 7)
    assert replace(CELL, varied=(("augmentation", "on"),)).settings(TrainSettings(), 0).jitter == TrainSettings().jitter


@pytest.mark.parametrize("name", [name for name in VARIED if name not in ("augmentation", "balance")])
def test_every_part_that_can_be_varied_is_one_of_the_recipe(name: str) -> None:
    (setting,) = varied_setting(name, "3")
    assert hasattr(TrainSettings(), setting)


def test_all_faults_of_axes_are_named_at_once() -> None:
    varied = {
        "mixup": ["0", "much"],
        "colour": ["red"],
        "lr": ["7"],
        "balance": ["yes"],
        "batch": [],
        "epochs": ["../x"],
    }
    faults = axis_faults(["rgb", "rgb", "hsv"], [1, None], varied, TrainSettings())
    text = "; ".join(faults)
    for expected in (
        "channels are 'hsv', expected one of: rgbd, rgb, depth",
        "size is 1, expected at least 2",
        "channels has a value twice (rgb, rgb, hsv)",
        "mixup is 'much', expected a number",
        "there is no 'colour' to vary",
        "learning rate is 7.0",
        "balance is 'yes', expected on or off",
        "there is no value of batch",
        "epochs is '../x', expected a short word or number",
    ):
        assert expected in text
    assert axis_faults(["rgb"], [2, None], {"mixup": ["0", "0.2"]}, TrainSettings()) == []


def test_a_part_that_is_none_is_refused() -> None:
    with pytest.raises(SweepPlanError, match="there is no 'seed' to vary"):
        varied_setting("seed", "1")
