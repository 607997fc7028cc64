"""A folder of all figures of an evaluation, each readable and the same again."""

from __future__ import annotations

from pathlib import Path

from tests.support.reports import make_evaluation
from tests.support.rrd import colours, read_picture

from handsight.viz.figures.evaluation import evaluation_figures

NAMES = {f"{name}{suffix}" for name in ("results", "table", "moves", "calibration") for suffix in (".png", ".svg")}


def test_every_figure_is_drawn_and_equal_results_give_equal_bytes(tmp_path: Path) -> None:
    written = evaluation_figures(make_evaluation(), tmp_path / "new" / "figures")
    assert {path.name for path in written} == NAMES
    again = evaluation_figures(make_evaluation(), tmp_path / "again")
    assert [path.read_bytes() for path in written] == [path.read_bytes() for path in again]
    assert all(colours(read_picture(path)) > 10 for path in written if path.suffix == ".png")


def test_where_nothing_servoed_there_are_rates_alone(tmp_path: Path) -> None:
    results = {**make_evaluation(), "durations": [], "calibration": []}
    assert {path.stem for path in evaluation_figures(results, tmp_path)} == {"results", "table"}


def test_a_rig_stands_beside_the_second_table_of_the_paper(tmp_path: Path) -> None:
    evaluation_figures(make_evaluation(), tmp_path, source="ur10")
    assert "paper, Table II" in (tmp_path / "table.svg").read_text(encoding="utf-8")
