from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from handsight.training.intervals import MeanOverTrials
from handsight.training.sweep.table import ObjectRow, SweepRow
from handsight.viz.errors import FigureError
from handsight.viz.figures.ablation import ablation_figure

MEAN = MeanOverTrials(mean=0.8, low=0.7, high=0.9, trials=5, p=None)
ROWS = [
    SweepRow(series=series, channels=series, size=size, trained_on=size, accuracy=MEAN, auc=replace(MEAN, mean=0.85))
    for series in ("rgb", "depth", "rgbd")
    for size in (250, 500)
]
OBJECTS = [
    ObjectRow(series=row.series, size=row.size, object=f"household/cup-{at}", attempts=10, correct=at)
    for row in ROWS
    for at in range(1, 5)
]


def test_the_same_rows_give_the_same_bytes_and_texts_can_be_searched(tmp_path: Path) -> None:
    png, svg = ablation_figure(ROWS, OBJECTS, tmp_path / "one.svg")
    again = ablation_figure(ROWS, OBJECTS, tmp_path / "two.svg")
    assert (png.read_bytes(), svg.read_bytes()) == tuple(path.read_bytes() for path in again)
    text = svg.read_text()
    for said in (
        "Balanced accuracy",
        "Area under the ROC curve",
        "rgbd",
        "250",
        "n = 5",
        "cup-4",
        "training sets of 500",
    ):
        assert said in text
    with Image.open(png) as picture:
        assert picture.width > 1000


def test_points_of_one_trial_have_no_interval(tmp_path: Path) -> None:
    lone = replace(MEAN, low=None, high=None, trials=1)
    rows = [replace(row, accuracy=lone, auc=lone) for row in ROWS]
    _, svg = ablation_figure(rows, [], tmp_path / "figure.png")
    assert "n = 1" in svg.read_text()


def test_without_points_there_is_no_figure(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match="no finished cell"):
        ablation_figure([], [], tmp_path / "figure.svg")
    assert not list(tmp_path.iterdir())
