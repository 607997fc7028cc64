"""The heatmap peaks where the gripper should go."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tests.support.drawn_table import BRIGHTNESS, CAMERA, DISC_XY_M, DISTANCE_M, GRID, START, DrawnTable
from tests.support.scorers import FunctionScorer

from handsight.servoing.errors import ScoreError, ServoSettingsError
from handsight.servoing.heatmap import grasp_heatmap
from handsight.servoing.planar import PlanarPose


def test_heatmap_peaks_where_the_gripper_should_go() -> None:
    world = DrawnTable(START)
    view, pose = world.look()
    heatmap = grasp_heatmap(view, BRIGHTNESS, spacing_px=4)
    row, column = np.unravel_index(heatmap.scores.argmax(), heatmap.scores.shape)
    k = CAMERA.intrinsics
    disc = pose.step_to(PlanarPose(x_m=DISC_XY_M[0], y_m=DISC_XY_M[1], angle_rad=0.0))
    expected_column = k.cx + (disc.dx_m - CAMERA.x_tool_camera_m) * k.fx / DISTANCE_M
    expected_row = k.cy + (disc.dy_m - CAMERA.y_tool_camera_m) * k.fy / DISTANCE_M
    assert abs(heatmap.columns_px[column] - expected_column) <= 4
    assert abs(heatmap.rows_px[row] - expected_row) <= 4


def test_a_turned_heatmap_scores_each_point_by_itself() -> None:
    view, _ = DrawnTable(START).look()
    straight, turned = (grasp_heatmap(view, BRIGHTNESS, spacing_px=6, angle_rad=angle) for angle in (0.0, 0.5))
    assert turned.angle_rad == 0.5
    # A disc looks alike from every side.
    peaks = [np.unravel_index(one.scores.argmax(), one.scores.shape) for one in (straight, turned)]
    for axis, pixels in enumerate(("rows_px", "columns_px")):
        places = [getattr(one, pixels)[peak[axis]] for one, peak in zip((straight, turned), peaks, strict=True)]
        assert abs(places[0] - places[1]) <= 6


@pytest.mark.parametrize("spacing_px", [0, -3, 121])
def test_a_spacing_that_leaves_no_point_is_refused(spacing_px: int) -> None:
    view, _ = DrawnTable(START).look()
    with pytest.raises(ServoSettingsError, match="at least 1 and at most 120"):
        grasp_heatmap(view, BRIGHTNESS, spacing_px=spacing_px)


def test_scores_that_are_none_make_no_map() -> None:
    view, _ = DrawnTable(START).look()
    scorer = FunctionScorer(lambda inputs: torch.full((len(inputs),), torch.nan), GRID)
    with pytest.raises(ScoreError, match=r"(\d+) of \1 scores"):
        grasp_heatmap(view, scorer, spacing_px=4)
