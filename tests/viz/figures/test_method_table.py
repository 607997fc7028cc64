"""The tables of the paper as figures, with their numbers read back."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.rrd import colours, read_picture

from handsight.evaluation.results import ResultRow, wilson_95
from handsight.servoing.methods.registry import METHODS
from handsight.viz.errors import FigureError
from handsight.viz.figures.method_table import TABLES, method_table_figure


def make_row(method: str, successes: int, trials: int, objects: str, step_ms: float | None = None) -> ResultRow:
    return ResultRow(
        method=method,
        objects=objects,
        trials=trials,
        aborted=0,
        successes=successes,
        rate=successes / trials,
        ci95=wilson_95(successes, trials),
        step_ms=step_ms,
        mean_steps=None,
    )


ROWS = [
    make_row("random", 7, 41, "blocks-train"),
    make_row("cem-1", 33, 42, "blocks-train", 31.4),
    make_row("random", 5, 40, "blocks-test"),
    make_row("cem-1", 22, 43, "blocks-test", 33.3),
]


def test_a_column_for_each_set_with_rates_and_times(tmp_path: Path) -> None:
    png, svg = method_table_figure(ROWS, tmp_path / "table")
    text = svg.read_text()
    for said in (
        "17.1 %",
        "78.6 %",
        "12.5 %",
        "51.2 %",
        "31 ms",
        "204 ms",
        "paper, Table I",
        "n = 40 to 43; objects never seen",
    ):
        assert said in text
    assert colours(read_picture(png)) > 20
    again = method_table_figure(ROWS, tmp_path / "again")
    assert [png.read_bytes(), svg.read_bytes()] == [path.read_bytes() for path in again]


def test_what_a_real_arm_did_stands_beside_the_second_table(tmp_path: Path) -> None:
    _, svg = method_table_figure(ROWS, tmp_path / "table", source="ur10")
    text = svg.read_text()
    assert "paper, Table II" in text
    assert "204 ms" not in text


def test_novel_rates_of_the_first_table_are_those_of_the_registry() -> None:
    _, table = TABLES["sim"]
    assert {name: row.testing for name, row in table.items()} == {
        name: method.paper_rate for name, method in METHODS.items() if method.paper_rate is not None
    }


def test_a_method_that_the_paper_lacks_is_drawn_and_wrong_rows_are_refused(tmp_path: Path) -> None:
    _, svg = method_table_figure([make_row("mine", 1, 2, "a$b$c")], tmp_path / "mine")
    assert "paper" not in svg.read_text()
    with pytest.raises(FigureError, match="no rows"):
        method_table_figure([], tmp_path / "none")
    with pytest.raises(FigureError, match="appears twice"):
        method_table_figure([ROWS[0], ROWS[0]], tmp_path / "twice")
    assert {path.stem for path in tmp_path.iterdir()} == {"mine"}
