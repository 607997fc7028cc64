"""Figures, read back: the numbers are in them, and equal rows give equal bytes."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from tests.support.rrd import colours, read_picture

from handsight.evaluation.results import ResultRow, wilson_95
from handsight.servoing.methods.registry import METHODS
from handsight.viz.errors import FigureError
from handsight.viz.figures.results import results_figure


def make_row(method: str, successes: int, trials: int, objects: str = "blocks-test") -> ResultRow:
    return ResultRow(
        method=method,
        objects=objects,
        trials=trials,
        aborted=0,
        successes=successes,
        rate=successes / trials,
        ci95=wilson_95(successes, trials),
        step_ms=None,
        mean_steps=None,
    )


ROWS = [make_row("random", 7, 41), make_row("cem-1", 33, 42), make_row("first-order", 30, 43)]


def test_the_results_hold_rates_counts_and_the_papers_figures(tmp_path: Path) -> None:
    png, svg = results_figure(ROWS, tmp_path / "results")
    assert (png.name, svg.name) == ("results.png", "results.svg")
    text = svg.read_text()
    for row in ROWS:
        assert f">{100 * row['rate']:.1f} %<" in text
        assert f">n = {row['trials']}<" in text
    for rate in [METHODS[row["method"]].paper_rate for row in ROWS]:
        assert rate is not None
        assert f">{100 * rate:.1f}<" in text
    assert "single-iteration" in text
    height, width = read_picture(png).shape[:2]
    assert width > height > 500
    assert colours(read_picture(png)) > 20


def test_equal_rows_give_equal_bytes(tmp_path: Path) -> None:
    first = [path.read_bytes() for path in results_figure(ROWS, tmp_path / "first.png")]
    again = [path.read_bytes() for path in results_figure(ROWS, tmp_path / "again.svg")]
    other = [path.read_bytes() for path in results_figure([make_row("random", 8, 41), *ROWS[1:]], tmp_path / "other")]
    assert first == again
    assert first[0] != other[0]
    assert first[1] != other[1]


def test_an_unknown_method_a_second_set_and_extreme_rates_are_drawn(tmp_path: Path) -> None:
    rows = [*ROWS, make_row("newton-raphson", 0, 9), make_row("newton-raphson", 9, 9, objects="blocks-train")]
    _, svg = results_figure(rows, tmp_path / "results")
    text = svg.read_text()
    for expected in ("newton-raphson", "blocks-train", ">0.0 %<", ">100.0 %<"):
        assert expected in text


def test_rows_that_cannot_be_drawn_are_all_reported(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match="no rows"):
        results_figure([], tmp_path / "results")
    wrong = make_row("cem-1", 3, 4)
    wrong["successes"] = 5
    far_off = make_row("first-order", 3, 4)
    far_off["rate"] = math.nan
    with pytest.raises(FigureError, match=r"(?s)row 1 .* 5 successes in 4 trials.*row 2 .* rate nan.*row 3 .* twice"):
        results_figure([ROWS[0], wrong, far_off, ROWS[0]], tmp_path / "results")
    with pytest.raises(FigureError, match="there is no folder"):
        results_figure(ROWS, tmp_path / "missing" / "results")
    assert list(tmp_path.iterdir()) == []
