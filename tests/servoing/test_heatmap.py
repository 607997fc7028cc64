"""The heatmap peaks where the gripper should go."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.drawn_table import CAMERA, DISC_XY_M, DISTANCE_M, GRID, START, DrawnTable, brightness_in_the_middle

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.heatmap import grasp_heatmap
from handsight.servoing.planar import PlanarPose


def test_heatmap_peaks_where_the_gripper_should_go() -> None:
    world = DrawnTable(START)
    view, pose = world.look()
    heatmap = grasp_heatmap(view, brightness_in_the_middle, grid=GRID, spacing_px=4)
    row, column = np.unravel_index(heatmap.scores.argmax(), heatmap.scores.shape)
    k = CAMERA.intrinsics
    disc = pose.step_to(PlanarPose(x_m=DISC_XY_M[0], y_m=DISC_XY_M[1], angle_rad=0.0))
    expected_column = k.cx + (disc.dx_m - CAMERA.x_tool_camera_m) * k.fx / DISTANCE_M
    expected_row = k.cy + (disc.dy_m - CAMERA.y_tool_camera_m) * k.fy / DISTANCE_M
    assert abs(heatmap.columns_px[column] - expected_column) <= 4
    assert abs(heatmap.rows_px[row] - expected_row) <= 4


def test_a_spacing_of_nothing_is_refused() -> None:
    view, _ = DrawnTable(START).look()
    with pytest.raises(ServoSettingsError, match="at least 1"):
        grasp_heatmap(view, brightness_in_the_middle, grid=GRID, spacing_px=0)
