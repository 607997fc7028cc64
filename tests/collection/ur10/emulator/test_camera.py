"""The emulated D435: frames, what a calibration target looks like, and faults that a step of a ladder cures."""

from __future__ import annotations

import time
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from tests.support.emulated_rig import RunningRig, running_rig

from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.collection.ur10.emulated_device import EmulatedCamera, EmulatedFrame
from handsight.collection.ur10.emulator.board import Board
from handsight.collection.ur10.emulator.camera import PORT
from handsight.collection.ur10.emulator.poses import matrix_of

FRAME_LIMIT_S = 10.0
NO_FRAME_S = 0.5


@pytest.fixture(scope="module")
def module_rig() -> Iterator[RunningRig]:
    with running_rig("--objects", "blocks-test", "--objects-per-scene", "1", camera=True) as running:
        running.do("put", object=0, position_m=[0.75, 0.1, 0.05])
        yield running


@pytest.fixture
def rig(module_rig: RunningRig) -> Iterator[RunningRig]:
    yield module_rig
    module_rig.do("clear")
    module_rig.do("board", gone=True)


def connected(rig: RunningRig) -> EmulatedCamera:
    """Connect as soon as it takes connections."""
    end = time.monotonic() + FRAME_LIMIT_S
    while True:
        try:
            return EmulatedCamera(rig.camera, PORT, timeout_s=FRAME_LIMIT_S)
        except OSError:
            if time.monotonic() > end:
                raise


def frames(rig: RunningRig, count: int) -> list[EmulatedFrame]:
    with connected(rig) as camera:
        return [camera.frame(FRAME_LIMIT_S) for _ in range(count)]


def test_frames_are_new_ones_of_what_is_there(rig: RunningRig) -> None:
    with connected(rig) as camera:
        assert camera.description["name"] == "Intel RealSense D435"
        assert (camera.description["width"], camera.description["height"]) == (640, 480)
        first, second = camera.frame(FRAME_LIMIT_S), camera.frame(FRAME_LIMIT_S)
    assert second.number > first.number
    assert second.timestamp_ms - first.timestamp_ms == pytest.approx(1e3 / 30 * (second.number - first.number), abs=0.1)
    assert (first.rgb != second.rgb).any()  # A sensor is never without noise.
    assert first.rgb.std() > 10
    height_m = rig.do("status")["tip_z_m"] - D435_ON_GRIPPER.z_tool_camera_m
    assert np.median(first.depth) * 0.001 == pytest.approx(height_m, abs=0.003)


def charuco(board: Board) -> cv2.aruco.CharucoBoard:
    words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    return cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, words)


def found(target: cv2.aruco.CharucoBoard, rig: RunningRig) -> tuple[np.ndarray, np.ndarray]:
    """Corners in the next picture, and which they are."""
    (frame,) = frames(rig, 1)
    grey = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(target).detectBoard(grey)
    return np.asarray(corners), np.asarray(ids)


def test_board_lies_on_an_empty_table_from_the_start() -> None:
    with running_rig("--objects", "blocks-test", "--empty", "--board", camera=True) as rig:
        assert rig.do("scene") == {"objects": []}
        _, ids = found(charuco(Board()), rig)
        assert len(ids) == (Board().columns - 1) * (Board().rows - 1)
        assert rig.do("refill", exchange=True) == {"put_back": 5}


def test_board_is_found_where_it_lies(rig: RunningRig) -> None:
    board = Board(x_m=0.62, y_m=0.05, angle_rad=0.3)
    rig.do("board", x_m=board.x_m, y_m=board.y_m, angle_rad=board.angle_rad)
    target = charuco(board)
    corners, ids = found(target, rig)
    assert len(ids) == (board.columns - 1) * (board.rows - 1)
    on_board_m, seen_px = target.matchImagePoints(list(corners), ids)
    k = D435_ON_GRIPPER.intrinsics
    camera_matrix = np.array([[k.fx, 0, k.cx], [0, k.fy, k.cy], [0, 0, 1]])
    _, _, offset_m = cv2.solvePnP(on_board_m, seen_px, camera_matrix, None)
    pose_base_camera = D435_ON_GRIPPER.pose_base_camera(matrix_of(rig.do("status")["flange_pose"]) @ tip())
    corner_m = (pose_base_camera @ np.append(offset_m[:, 0], 1.0))[:3]
    cos, sin = np.cos(board.angle_rad), np.sin(board.angle_rad)
    half_m = 0.5 * np.array([board.columns, -board.rows]) * board.square_m
    expected = [board.x_m - cos * half_m[0] + sin * half_m[1], board.y_m - sin * half_m[0] - cos * half_m[1], 0.0]
    assert corner_m == pytest.approx(expected, abs=2e-3)


def tip() -> np.ndarray:
    pose = np.eye(4)
    pose[2, 3] = 0.16
    return pose


@pytest.mark.parametrize("cure", ["restart", "reset"])
def test_frozen_camera_is_cured_by_its_step_of_the_ladder(rig: RunningRig, cure: str) -> None:
    camera = connected(rig)
    camera.frame(FRAME_LIMIT_S)
    rig.do("fault", fault=f"camera-frozen:cure={cure}")
    before, after = camera.frame(FRAME_LIMIT_S), camera.frame(FRAME_LIMIT_S)
    assert after.number > before.number
    assert (before.rgb == after.rgb).all()
    camera.close()
    before, after = frames(rig, 2)
    assert (before.rgb == after.rgb).all() == (cure == "reset")
    with connected(rig) as camera:
        camera.hardware_reset()
    before, after = frames(rig, 2)
    assert (before.rgb != after.rgb).any()


def test_stale_camera_repeats_its_number(rig: RunningRig) -> None:
    with connected(rig) as camera:
        camera.frame(FRAME_LIMIT_S)
        rig.do("fault", fault="camera-stale")
        before, after = camera.frame(FRAME_LIMIT_S), camera.frame(FRAME_LIMIT_S)
    assert (before.number, before.timestamp_ms) == (after.number, after.timestamp_ms)


def test_black_and_blind_cameras(rig: RunningRig) -> None:
    with connected(rig) as camera:
        rig.do("fault", fault="camera-black:cure=reset")
        assert not camera.frame(FRAME_LIMIT_S).rgb.any()
        rig.do("fault", fault="camera-no-depth:cure=reset")
        frame = camera.frame(FRAME_LIMIT_S)
    assert frame.rgb.any()
    assert not frame.depth.any()


def test_camera_that_drops_out_sends_nothing_until_it_is_connected_anew(rig: RunningRig) -> None:
    with connected(rig) as camera:
        camera.frame(FRAME_LIMIT_S)
        rig.do("fault", fault="camera-dropout")
        with pytest.raises(TimeoutError):
            camera.frame(NO_FRAME_S)
    assert len(frames(rig, 1)) == 1


def test_unplugged_camera_comes_back_by_its_power(rig: RunningRig) -> None:
    rig.do("fault", fault="camera-unplugged")
    with pytest.raises(OSError, match="refused"):
        EmulatedCamera(rig.camera, PORT, timeout_s=FRAME_LIMIT_S)
    assert rig.do("camera-power-cycle") == {"power_cycled": True}
    assert len(frames(rig, 1)) == 1
