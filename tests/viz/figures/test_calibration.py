from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.rrd import colours, read_picture

from handsight.evaluation.calibration import CalibrationRow
from handsight.evaluation.results import wilson_95
from handsight.viz.errors import FigureError
from handsight.viz.figures.calibration import calibration_figure


def make_row(method: str, low: float, successes: int, trials: int, objects: str = "blocks-test") -> CalibrationRow:
    return CalibrationRow(
        method=method,
        objects=objects,
        low=low,
        high=low + 0.1,
        trials=trials,
        mean_score=low + 0.05,
        successes=successes,
        rate=successes / trials,
        ci95=wilson_95(successes, trials),
    )


ROWS = [make_row("cem-1", 0.4, 3, 9), make_row("cem-1", 0.9, 30, 33), make_row("first-order", 0.9, 20, 30)]


def test_a_panel_for_each_method_and_set_and_equal_rows_give_equal_bytes(tmp_path: Path) -> None:
    png, svg = calibration_figure(ROWS, tmp_path / "calibration")
    text = svg.read_text()
    for said in ("single-iteration CEM", "first-order ascent", "blocks-test, 42 trials", "as predicted"):
        assert said in text
    assert colours(read_picture(png)) > 20
    again = calibration_figure(ROWS, tmp_path / "again.svg")
    assert [png.read_bytes(), svg.read_bytes()] == [path.read_bytes() for path in again]
    wide, _ = calibration_figure([*ROWS, make_row("cem-1", 0.9, 1, 2, "a$b$c")], tmp_path / "wide")
    assert read_picture(wide).shape[1] > 1.3 * read_picture(png).shape[1]


def test_more_panels_than_fit_side_by_side_go_below(tmp_path: Path) -> None:
    rows = [make_row(f"method-{number}", 0.9, 1, 2) for number in range(5)]
    tall, _ = calibration_figure(rows, tmp_path / "tall")
    flat, _ = calibration_figure(rows[:4], tmp_path / "flat")
    assert read_picture(tall).shape[1] == read_picture(flat).shape[1]
    assert read_picture(tall).shape[0] > 1.5 * read_picture(flat).shape[0]


def test_rows_that_cannot_be_drawn_are_all_reported(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match=r"no rows, .* a method that servoes"):
        calibration_figure([], tmp_path / "none")
    wrong, far = {**ROWS[0], "successes": 10}, {**ROWS[1], "mean_score": 0.2}
    with pytest.raises(FigureError, match=r"0\.5 has 10 of 9 held.* mean score 0\.2.*appears twice"):
        calibration_figure([wrong, far, ROWS[2], ROWS[2]], tmp_path / "wrong")  # type: ignore[list-item]
    assert list(tmp_path.iterdir()) == []
