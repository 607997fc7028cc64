"""Figures, read back: the numbers are in them, and equal rows give equal bytes."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from tests.support.rrd import colours, read_picture

from handsight.evaluation.results import ResultRow, wilson_95
from handsight.servoing.methods.registry import METHODS
from handsight.viz.errors import FigureError
from handsight.viz.examples import HeatmapExample
from handsight.viz.figures.montage import LEFT_MARGIN, TITLE_PX, montage_figure
from handsight.viz.figures.pictures import GAP_PX, WIDTH_PX
from handsight.viz.figures.results import results_figure


def make_row(method: str, successes: int, trials: int, objects: str = "blocks-test") -> ResultRow:
    return ResultRow(
        method=method,
        objects=objects,
        trials=trials,
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
    for rate in [method.paper_rate for method in METHODS.values() if method.paper_rate is not None]:
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
    rows = [*ROWS, make_row("gauss-newton", 0, 9), make_row("gauss-newton", 9, 9, objects="blocks-train")]
    _, svg = results_figure(rows, tmp_path / "results")
    text = svg.read_text()
    for expected in ("gauss-newton", "blocks-train", ">0.0 %<", ">100.0 %<"):
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
    with pytest.raises(FigureError, match="existing folder"):
        results_figure(ROWS, tmp_path / "missing" / "results")
    assert list(tmp_path.iterdir()) == []


def test_the_montage_is_as_wide_as_a_readme_and_reproducible(examples: list[HeatmapExample], tmp_path: Path) -> None:
    strip = [*examples, examples[0]]
    path = montage_figure(tmp_path / "montage.png", strip)
    picture = read_picture(path)
    assert picture.shape[1] == WIDTH_PX
    assert colours(picture) > 1000
    assert picture[-1, 0, :3].tolist() == [255, 255, 255]
    assert path.read_bytes() == montage_figure(tmp_path / "again.png", strip).read_bytes()


def test_long_titles_of_a_montage_do_not_meet(examples: list[HeatmapExample], tmp_path: Path) -> None:
    strip = [dataclasses.replace(examples[0], title=40 * "W", held=True) for _ in range(4)]
    titles = read_picture(montage_figure(tmp_path / "montage.png", strip))[:TITLE_PX, :, :3]
    inked = np.asarray((titles < 200).any(axis=(0, 2)))
    left, width = LEFT_MARGIN * WIDTH_PX, (1 - LEFT_MARGIN) * WIDTH_PX / len(strip)
    gaps = [round(left + column * width) - GAP_PX // 2 for column in range(len(strip))]
    assert inked.sum() > WIDTH_PX // 2
    assert not inked[gaps].any()


def test_a_montage_of_pictures_that_do_not_match_is_refused(examples: list[HeatmapExample], tmp_path: Path) -> None:
    with pytest.raises(FigureError, match="no examples"):
        montage_figure(tmp_path / "montage.png", [])
    view = examples[0].view
    intrinsics = dataclasses.replace(view.camera.intrinsics, width=320)
    narrow = dataclasses.replace(
        view,
        rgb=view.rgb[:, :320],
        depth_m=view.depth_m[:, :320],
        camera=dataclasses.replace(view.camera, intrinsics=intrinsics),
    )
    with pytest.raises(FigureError, match=r"sizes \[\(480, 320\), \(480, 640\)\], expected one"):
        montage_figure(tmp_path / "montage.png", [examples[0], dataclasses.replace(examples[1], view=narrow)])
    assert list(tmp_path.iterdir()) == []
