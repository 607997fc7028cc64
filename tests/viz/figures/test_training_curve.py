from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.support.rrd import colours, read_picture

from handsight.viz.errors import FigureError
from handsight.viz.figures.training_curve import training_curve_figure


def make_record(passes: int, *, known: bool = True) -> dict[str, Any]:
    history = [
        {
            "number": number,
            "train_loss": 1 / number,
            "held_out": {
                "attempts": 12,
                "loss": 1.2 / number if known else None,
                "auc": 1 - 0.4 / number if known else None,
                "accuracy": 1 - 0.5 / number if known else None,
            },
        }
        for number in range(1, passes + 1)
    ]
    return {"history": history, "kept_epoch": passes}


def test_curves_name_the_pass_that_was_kept_and_equal_records_give_equal_bytes(tmp_path: Path) -> None:
    png, svg = training_curve_figure(make_record(9), tmp_path / "curve")
    text = svg.read_text()
    for said in ("training", "held out", "balanced accuracy", "kept: pass 9", "12 attempts held out"):
        assert said in text
    assert colours(read_picture(png)) > 20
    again = training_curve_figure(make_record(9), tmp_path / "again")
    assert [png.read_bytes(), svg.read_bytes()] == [path.read_bytes() for path in again]


def test_a_single_pass_and_too_few_held_out_are_drawn(tmp_path: Path) -> None:
    _, svg = training_curve_figure(make_record(1, known=False), tmp_path / "curve")
    assert "too few attempts held out to say" in svg.read_text()


def test_a_record_without_passes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match="no pass to draw"):
        training_curve_figure(make_record(0), tmp_path / "curve")
    assert list(tmp_path.iterdir()) == []
