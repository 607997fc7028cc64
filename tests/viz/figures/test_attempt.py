"""The picture of an attempt, read back: both views, and the grasp where it was to be."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.support.factories import make_attempt, make_header
from tests.support.rrd import read_picture

from handsight.datasets import GraspAttempt, Outcome, RgbdFrame
from handsight.servoing.planar import PlanarPose
from handsight.viz import palette
from handsight.viz.errors import FigureError
from handsight.viz.figures.attempt import LEFT_PX, RIGHT_PX, TOP_PX, attempt_figure
from handsight.viz.figures.pictures import GAP_PX, WIDTH_PX

HEADER = make_header(width=64, height=48)
STATION = HEADER.station
HEIGHT_M = 0.5
CELL_PX = (WIDTH_PX - LEFT_PX - RIGHT_PX - GAP_PX) / 2


def frame(*, x_m: float = 0.6, y_m: float = 0.1, angle_rad: float = 0.4) -> RgbdFrame:
    """A bare grey table, seen from half a metre above it."""
    depth_m = HEIGHT_M - STATION.camera.z_tool_camera_m
    return RgbdFrame(
        rgb=np.full((48, 64, 3), 128, np.uint8),
        depth=np.full((48, 64), round(depth_m / STATION.depth_scale_m), np.uint16),
        pose_base_tool=PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad).pose_base_tool(HEIGHT_M),
    )


def attempt(**changes: object) -> GraspAttempt:
    plain = make_attempt(HEADER, 0, outcome=Outcome.HELD)
    values = {"overhead": frame(), "pregrasp": None, "pregrasp_x_m": 0.6, "pregrasp_y_m": 0.1}
    return replace(plain, **{**values, "pregrasp_angle_rad": 0.4, **changes})  # type: ignore[arg-type]  # By name.


def jaws_at(path: Path, colour: palette.Rgb) -> tuple[float, float]:
    """Middle of what has the colour in the left picture, in pixels of the raw picture: column, row."""
    picture = read_picture(path)[TOP_PX : round(TOP_PX + 0.75 * CELL_PX), LEFT_PX : round(LEFT_PX + CELL_PX), :3]
    rows, columns = np.nonzero((np.abs(picture.astype(int) - np.array(colour)) < 12).all(-1))
    assert len(rows) > 20
    column, row = (0.5 * float(found.min() + found.max() + 1) * 64 / CELL_PX - 0.5 for found in (columns, rows))
    return column, row


def expected_at(dx_m: float, dy_m: float) -> tuple[float, float]:
    """Where a place on the table beside the tool lies in the raw picture, by the camera's own formula."""
    camera, k = STATION.camera, STATION.camera.intrinsics
    far_m = HEIGHT_M - camera.z_tool_camera_m
    return (
        k.cx + k.fx * (dx_m - camera.x_tool_camera_m) / far_m,
        k.cy + k.fy * (dy_m - camera.y_tool_camera_m) / far_m,
    )


@pytest.mark.parametrize(("success", "colour"), [(True, palette.HELD), (False, palette.EMPTY), (None, palette.CHOSEN)])
def test_the_jaws_are_where_the_grasp_was_to_be(success: bool | None, colour: palette.Rgb, tmp_path: Path) -> None:
    path = attempt_figure(tmp_path / "a.png", "id-000000", attempt(), STATION, success=success)
    assert jaws_at(path, colour) == pytest.approx(expected_at(0.0, 0.0), abs=0.6)
    goal = PlanarPose(x_m=0.6 + 0.05 * math.cos(0.4), y_m=0.1 + 0.05 * math.sin(0.4), angle_rad=1.2)
    moved = attempt(pregrasp_x_m=goal.x_m, pregrasp_y_m=goal.y_m, pregrasp_angle_rad=goal.angle_rad)
    path = attempt_figure(tmp_path / "b.png", "id-000000", moved, STATION, success=success)
    assert jaws_at(path, colour) == pytest.approx(expected_at(0.05, 0.0), abs=0.6)


def test_each_view_taken_has_a_row_and_equal_attempts_equal_bytes(tmp_path: Path) -> None:
    one = attempt_figure(tmp_path / "one.png", "id-000000", attempt(), STATION, success=True)
    both = attempt(pregrasp=frame(x_m=0.61))
    two = attempt_figure(tmp_path / "two.png", "id-000000", both, STATION, success=True)
    assert read_picture(one).shape[1] == read_picture(two).shape[1] == WIDTH_PX
    assert read_picture(two).shape[0] > 1.8 * read_picture(one).shape[0]
    again = attempt_figure(tmp_path / "again.png", "id-000000", both, STATION, success=True)
    assert again.read_bytes() == two.read_bytes()


def test_no_goal_and_no_depth_are_drawn_without(tmp_path: Path) -> None:
    blind = replace(frame(), depth=np.zeros((48, 64), np.uint16))
    nowhere = attempt(overhead=blind, pregrasp_x_m=math.nan, pregrasp_y_m=math.nan, pregrasp_angle_rad=math.nan)
    picture = read_picture(attempt_figure(tmp_path / "a.png", "id", nowhere, STATION, success=None))
    middle = picture[TOP_PX + 100, round(LEFT_PX + 1.5 * CELL_PX), :3]
    assert middle.tolist() == [0x9A, 0xA1, 0xAA]


def test_what_cannot_be_drawn_is_refused(tmp_path: Path) -> None:
    dark = attempt(overhead=None, failure="look: no frame")
    with pytest.raises(FigureError, match=r"id-7 ended before it took a picture \(look: no frame\)"):
        attempt_figure(tmp_path / "a.png", "id-7", dark, STATION, success=None)
    with pytest.raises(FigureError, match=r"ends in \.png"):
        attempt_figure(tmp_path / "a.svg", "id-7", attempt(), STATION, success=None)
    assert list(tmp_path.iterdir()) == []
