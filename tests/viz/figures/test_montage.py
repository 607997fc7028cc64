"""A strip of examples, as wide as a README and reproducible."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from tests.support.rrd import colours, read_picture

from handsight.viz.errors import FigureError
from handsight.viz.examples import HeatmapExample
from handsight.viz.figures.montage import LEFT_MARGIN, RIGHT_PX, TITLE_PX, montage_figure
from handsight.viz.figures.pictures import GAP_PX, WIDTH_PX


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
    left = LEFT_MARGIN * WIDTH_PX
    width = (WIDTH_PX - left - RIGHT_PX) / len(strip)
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
