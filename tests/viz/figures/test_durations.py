from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.rrd import colours, read_picture

from handsight.evaluation.durations import DurationRow
from handsight.servoing.methods.registry import METHODS
from handsight.viz.errors import FigureError
from handsight.viz.figures.durations import durations_figure


def make_rows(
    method: str, objects: str = "household-test", *, trials: int = 5, successes: int = 4
) -> list[DurationRow]:
    limit = METHODS[method].max_steps
    return [
        DurationRow(
            method=method, objects=objects, moves=moves, trials=trials, successes=successes, limit=moves == limit
        )
        for moves in range(limit + 1)
    ]


ROWS = [*make_rows("cem-1"), *make_rows("first-order")]


def test_a_panel_for_each_method_and_set_and_equal_rows_give_equal_bytes(tmp_path: Path) -> None:
    path = durations_figure(ROWS, tmp_path / "moves.png")
    picture = read_picture(path)
    assert colours(picture) > 20
    assert path.read_bytes() == durations_figure(ROWS, tmp_path / "again.png").read_bytes()
    wide = durations_figure([*ROWS, *make_rows("cem-1", "blocks-test")], tmp_path / "wide.png")
    assert read_picture(wide).shape[1] > 1.5 * picture.shape[1]
    low = durations_figure([*make_rows("cem-1", successes=1), *make_rows("first-order")], tmp_path / "low.png")
    assert low.read_bytes() != path.read_bytes()


def test_methods_without_a_trial_are_drawn(tmp_path: Path) -> None:
    assert durations_figure(make_rows("cem-1", trials=0, successes=0), tmp_path / "moves.png").exists()


def test_rows_that_cannot_be_drawn_are_all_reported(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match=r"no rows, .* a method that servoes"):
        durations_figure([], tmp_path / "moves.png")
    wrong = {**ROWS[1], "successes": 6}
    with pytest.raises(FigureError, match=r"with 1 move has 6 of 5 held.*with 0 moves appears twice"):
        durations_figure([ROWS[0], wrong, ROWS[0]], tmp_path / "moves.png")  # type: ignore[list-item]
    with pytest.raises(FigureError, match="there is no folder"):
        durations_figure(ROWS, tmp_path / "missing" / "moves.png")
    assert list(tmp_path.iterdir()) == []
