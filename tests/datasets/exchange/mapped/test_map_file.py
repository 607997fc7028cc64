"""A map says what is wrong with it: everything, at once, by line and name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.foreign_sets import HDF5_MAP, LEROBOT_MAP, write_map

from handsight.datasets import InterchangeError
from handsight.datasets.exchange.mapped.map_file import read_map


def test_what_is_left_out_has_a_default(tmp_path: Path) -> None:
    grasps = read_map(write_map(tmp_path / "map.toml", LEROBOT_MAP))
    assert (grasps.label_frame, grasps.label_success, grasps.label_above) == ("last", None, 0.5)
    assert (grasps.picture_frame, grasps.depth, grasps.grasp_frame) == ("first", None, "lowest")
    assert (grasps.closed_width_m, grasps.pregrasp_height_m, grasps.table_z_m) == (0.002, 0.4, 0.0)
    np.testing.assert_array_equal(grasps.column_to_tool, np.eye(4))
    assert grasps.pose_base_camera is None
    assert read_map(write_map(tmp_path / "map.toml", HDF5_MAP)).pose_unit_m == 1e-3


def test_all_faults_are_said_at_once_by_line(tmp_path: Path) -> None:
    path = write_map(
        tmp_path / "map.toml",
        LEROBOT_MAP,
        label={"colum": "x"},
        pose={"convention": "rpy"},
        camera={"fx": "30"},
        gripper={"stroke_m": 85},
        table={"z_m": 1},
    )
    with pytest.raises(InterchangeError) as caught:
        read_map(path)
    said = str(caught.value)
    assert "line 3: [label] colum is unknown, expected column, frame" in said
    assert "[pose] convention is 'rpy', expected one of xyz_rotvec" in said
    assert "[camera] fx is '30', expected pixels" in said
    assert "[gripper] stroke_m is 85, expected metres from 0.005 to 0.5: millimetres?" in said
    assert "[table] is unknown" in said
    assert "\n" not in said


WRONG: dict[str, tuple[dict[str, dict[str, Any]], str]] = {
    "no camera pose": ({"camera": {"pose_tool_camera": None}}, "has no pose, expected pose_tool_camera"),
    "two camera poses": ({"camera": {"pose_base_camera": [0, 0, 1]}}, "pose_tool_camera and pose_base_camera"),
    "a camera in millimetres": ({"camera": {"pose_tool_camera": [0, -70, -110]}}, "within 10 m: millimetres?"),
    "no rotation": ({"camera": {"pose_tool_camera": [[1, 0, 0, 0]] * 4}}, "an orthonormal rotation"),
    "a ragged transform": ({"camera": {"pose_tool_camera": [[1], [2, 3]]}}, "three numbers, six, or four rows"),
    "two labels": ({"label": {"above": 1, "success": True}}, "expected one of them"),
    "a plane without height": ({"pose": {"convention": "x_y_angle", "grasp_frame": 0}}, "lacks z_m"),
    "a frame": ({"picture": {"frame": "middle"}}, "frame is 'middle', expected first, last or a number"),
    "a unit": ({"picture": {"depth": "d", "depth_unit": "cm"}}, "mm, m, or the metres of one unit"),
    "a truth value for a number": ({"pose": {"first": True}}, "first is true, expected a place"),
    "closed wider than open": ({"gripper": {"closed_width_m": 0.09}}, "closed_width_m is not below stroke_m"),
    "a missing table": ({"gripper": {"stroke_m": None}}, r"\[gripper\] lacks stroke_m"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_map_that_means_nothing_is_refused(tmp_path: Path, name: str) -> None:
    changes, said = WRONG[name]
    with pytest.raises(InterchangeError, match=said):
        read_map(write_map(tmp_path / "map.toml", LEROBOT_MAP, **changes))


@pytest.mark.parametrize("content", [b"label = ", b"\xff\xfe", b"[a]\n[a]\n", b"x = " + b"[" * 5000, b" " * (2 << 20)])
def test_what_is_no_toml_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "map.toml").write_bytes(content)
    with pytest.raises(InterchangeError, match=r"is no TOML|cannot be read as a map|expected a map"):
        read_map(tmp_path / "map.toml")
    with pytest.raises(InterchangeError, match="cannot be read as a map"):
        read_map(tmp_path / "none.toml")
