"""Pictures of the station: ``collect picture``, and the scene camera of a servo run."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from tests.support.rrd import colours
from tests.support.scorers import FunctionScorer
from torch import Tensor

from handsight.cli.app import run
from handsight.cli.wiring.scene_pictures import servo_pictures
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation
from handsight.evaluation.trial import run_trial
from handsight.servoing.loop import ServoSettings


def score_what_is_tall(inputs: Tensor) -> Tensor:
    """High where something stands in the middle. (B, 4, 64, 64) -> (B,)."""
    return torch.sigmoid(60 * (-inputs[:, 3, 30:34, 30:34].mean((1, 2)) - 0.05))


def test_the_station_is_drawn_into_a_file(tmp_path: Path) -> None:
    out = tmp_path / "station.png"
    assert run(["collect", "picture", "--out", str(out), "--seed", "2"]) == 0
    picture = cv2.imread(str(out))
    assert picture is not None
    assert picture.shape == (720, 960, 3)
    assert colours(picture) > 1000  # not a blank


@pytest.mark.parametrize("name", ["station.jpg", "station"])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert run(["collect", "picture", "--out", str(tmp_path / name)]) == 2
    assert "ends in .png" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["collect", "picture", "--out", str(tmp_path / "none" / "station.png")]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "create it first" in message


def test_every_step_of_a_servo_run_has_its_picture() -> None:
    config = SimConfig(objects="blocks-test")
    station = SimStation(config)
    try:
        settings = ServoSettings(threshold=0.99)
        _, recording = run_trial(station, FunctionScorer(score_what_is_tall), "cem-1", 1, seed=3, settings=settings)
    finally:
        station.close()
    assert recording is not None
    steps = recording.trace.steps[:3]
    pictures = servo_pictures(config, replace(recording, trace=replace(recording.trace, steps=steps)))
    assert len(pictures) == len(steps) == 3
    for before, after in pairwise(pictures):
        assert (np.abs(before.astype(int) - after).max(axis=2) > 12).sum() > 50  # the arm has moved
