"""Where the camera sits: solved from views, kept in a file, and refused where it is another's."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.support.rig_files import true_calibration

from handsight.collection.errors import RigSettingsError
from handsight.collection.ur10.calibration import Calibration, check_calibration, load_calibration, save_calibration
from handsight.collection.ur10.hand_eye import solve_hand_eye
from handsight.collection.ur10.rectify import Rectifier
from handsight.servoing.camera import Intrinsics

Pose = NDArray[np.float64]


def transform(rotation_rad: tuple[float, float, float], translation_m: tuple[float, float, float]) -> Pose:
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(np.array(rotation_rad))[0]
    pose[:3, 3] = translation_m
    return pose


CAMERA = transform((0.02, -0.015, 0.03), (0.001, -0.056, -0.098))
BOARD = transform((math.pi - 0.01, 0.0, 0.02), (0.65, 0.01, 0.0))


def views(count: int, *, tilt_rad: float, noise_m: float = 0.0) -> tuple[list[Pose], list[Pose]]:
    rng = np.random.default_rng(3)
    tools, boards = [], []
    for _ in range(count):
        turn = transform((math.pi, 0.0, 0.0), (0.0, 0.0, 0.0)) @ transform(
            (*rng.uniform(-tilt_rad, tilt_rad, 2), rng.uniform(-0.7, 0.7)), (0.0, 0.0, 0.0)
        )
        turn[:3, 3] = np.array([0.65, 0.0, 0.4]) + rng.uniform(-0.05, 0.05, 3)
        board = np.linalg.inv(turn @ CAMERA) @ BOARD
        board[:3, 3] += noise_m * rng.standard_normal(3)
        tools.append(turn)
        boards.append(board)
    return tools, boards


def test_views_without_noise_give_the_camera_back() -> None:
    answer = solve_hand_eye(*views(8, tilt_rad=0.3))
    np.testing.assert_allclose(answer.pose_tool_camera, CAMERA, atol=1e-9)
    assert answer.residual_m < 1e-9


def test_noise_shows_in_the_residual_and_hardly_in_the_answer() -> None:
    answer = solve_hand_eye(*views(20, tilt_rad=0.3, noise_m=0.0005))
    assert np.linalg.norm(answer.pose_tool_camera[:3, 3] - CAMERA[:3, 3]) < 0.002
    assert 0.0003 < answer.residual_m < 0.002


def test_it_agrees_with_opencv() -> None:
    tools, boards = views(12, tilt_rad=0.3, noise_m=0.0003)
    rotation, translation = cv2.calibrateHandEye(
        [tool[:3, :3] for tool in tools],
        [tool[:3, 3] for tool in tools],
        [board[:3, :3] for board in boards],
        [board[:3, 3] for board in boards],
        method=cv2.CALIB_HAND_EYE_PARK,
    )
    answer = solve_hand_eye(tools, boards).pose_tool_camera
    np.testing.assert_allclose(answer[:3, :3], rotation, atol=1e-3)
    np.testing.assert_allclose(answer[:3, 3], np.asarray(translation)[:, 0], atol=1e-3)


def test_too_few_views_and_turns_about_one_axis_are_refused() -> None:
    with pytest.raises(RigSettingsError, match="seen in 4 views, expected at least 6"):
        solve_hand_eye(*views(4, tilt_rad=0.3))
    with pytest.raises(RigSettingsError, match="turn about one axis only"):
        solve_hand_eye(*views(8, tilt_rad=0.0))


def test_a_calibration_is_the_same_after_it_was_kept(tmp_path: Path) -> None:
    kept = true_calibration()
    save_calibration(tmp_path / "c.json", kept)
    found = load_calibration(tmp_path / "c.json")
    assert (found, found.id) == (kept, kept.id)


def test_nothing_measured_yet_is_no_error_until_it_is_needed(tmp_path: Path) -> None:
    assert load_calibration(tmp_path / "none.json") == Calibration()
    with pytest.raises(RigSettingsError, match="run 'rig calibrate camera' first"):
        check_calibration(Calibration(), tmp_path / "none.json", "")


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        ("[]", "it is a list of 0, expected an object with camera"),
        ("{", "cannot be read"),
        ("[" * 100_000, "cannot be read"),
        ('{"camera": 3}', "camera is 3, expected an object with date"),
        ('{"camera": {"serial": 1}}', "camera.serial is 1, expected text"),
        ('{"table": {"colour": 1}}', "table.fields 'colour' are unknown"),
        ('{"jaws": null, "plane": {}}', "fields 'plane' are unknown"),
    ],
)
def test_a_damaged_file_is_refused(tmp_path: Path, damage: str, told: str) -> None:
    (tmp_path / "c.json").write_text(damage, encoding="utf-8")
    with pytest.raises(RigSettingsError, match=r"calibration .*c\.json") as refused:
        load_calibration(tmp_path / "c.json")
    assert told in str(refused.value)


def test_every_value_that_no_rig_has_is_told_at_once(tmp_path: Path) -> None:
    values = true_calibration().to_json()
    values["camera"] |= {"translation_m": [0.0, -55.0, -0.1], "residual_m": float("nan"), "views": -1}
    values["table"] = {"date": "x", "height_m": 12.0, "tilt_rad": 0.0, "residual_m": 0.0, "points": 5}
    (tmp_path / "c.json").write_text(json.dumps(values), encoding="utf-8")
    with pytest.raises(RigSettingsError, match="calibrate anew") as refused:
        load_calibration(tmp_path / "c.json")
    for part in ("translation_m is -55.0", "residual_m is nan", "views is -1", "height_m is 12.0, expected -2 to 2"):
        assert part in str(refused.value)


def test_a_file_that_was_changed_by_hand_is_told_from_what_was_measured(tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    kept = true_calibration()
    save_calibration(path, kept)
    values = json.loads(path.read_text(encoding="utf-8"))
    values["camera"]["translation_m"][1] += 0.01
    path.write_text(json.dumps(values), encoding="utf-8")
    with pytest.raises(RigSettingsError, match=f"id is '{kept.id}', expected"):
        load_calibration(path)
    del values["id"]
    path.write_text(json.dumps(values), encoding="utf-8")
    assert load_calibration(path).id != kept.id


def test_another_camera_and_a_camera_that_is_mounted_askew_are_both_told(tmp_path: Path) -> None:
    found = true_calibration().camera
    assert found is not None
    askew = Calibration(camera=replace(found, rotation_rad=(0.0, 0.0, 1.57)))
    with pytest.raises(RigSettingsError, match=r"of the camera 934222071234, and the rig has 42; .*turned by 1\.57"):
        check_calibration(askew, tmp_path, "42")


def test_a_rectified_picture_is_that_of_a_parallel_camera() -> None:
    """A plane of depth, and a point on it, seen by a turned camera and by one that is not."""
    k = Intrinsics.from_vertical_fov(width=160, height=120, fov_y_rad=0.8)
    rotation = np.asarray(cv2.Rodrigues(np.array([0.05, -0.03, 0.04]))[0], dtype=np.float64)
    columns, rows = np.meshgrid(np.arange(k.width), np.arange(k.height))
    rays = np.stack(((columns - k.cx) / k.fx, (rows - k.cy) / k.fy, np.ones(columns.shape)), axis=-1)
    # The plane is at distance 0.5 m along the tool's axis.
    depth = np.rint(500 / (rays @ rotation[2])).astype(np.uint16)
    rgb = np.zeros((120, 160, 3), np.uint8)
    point = rotation.T @ np.array([0.02, 0.01, 0.5])
    u, v = round(k.fx * point[0] / point[2] + k.cx), round(k.fy * point[1] / point[2] + k.cy)
    rgb[v - 2 : v + 3, u - 2 : u + 3] = 255
    turned, flat = Rectifier(k, rotation).turned(rgb, depth)
    assert set(np.unique(flat[30:90, 40:120])) <= {499, 500, 501}
    seen_v, seen_u = np.argwhere(turned[..., 0] > 127).mean(axis=0)
    assert (seen_u, seen_v) == pytest.approx((k.fx * 0.04 + k.cx, k.fy * 0.02 + k.cy), abs=1.0)


def test_a_parallel_camera_is_left_alone() -> None:
    k = Intrinsics.from_vertical_fov(width=32, height=24, fov_y_rad=0.8)
    rgb, depth = np.ones((24, 32, 3), np.uint8), np.ones((24, 32), np.uint16)
    turned, flat = Rectifier(k, np.eye(3)).turned(rgb, depth)
    assert turned is rgb
    assert flat is depth


def test_the_file_is_plain_json(tmp_path: Path) -> None:
    save_calibration(tmp_path / "c.json", true_calibration())
    values = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    assert values["camera"]["serial"] == "934222071234"
    assert values["id"] == true_calibration().id
