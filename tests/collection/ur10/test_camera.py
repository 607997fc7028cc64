"""Pictures of the rig's camera: what is wrong with one, what is done about it, and a recording on the same path."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from tests.support.emulated_rig import running_rig

from handsight.collection.errors import DeviceError, DeviceLostError
from handsight.collection.ur10.camera import Camera, picture_fault
from handsight.collection.ur10.camera_client import Picture
from handsight.collection.ur10.depth_filling import filled_depth
from handsight.collection.ur10.rig import CameraConfig

CONFIG = CameraConfig(kind="emulated", address="127.0.0.3", timeout_s=1.0)


def picture(number: int = 1, *, level: int | None = None, valid: float = 0.9, seed: int | None = None) -> Picture:
    rng = np.random.default_rng(number if seed is None else seed)
    rgb = rng.integers(0, 255, (8, 8, 3), dtype=np.uint8) if level is None else np.full((8, 8, 3), level, np.uint8)
    return Picture(
        number=number, timestamp_ms=33.0 * number, rgb=rgb, depth=np.full((8, 8), 500, np.uint16), valid=valid
    )


def digest(of: Picture) -> bytes:
    return hashlib.blake2b(of.rgb.tobytes(), digest_size=16).digest()


@pytest.mark.parametrize(
    ("now", "before", "part"),
    [
        (picture(2), picture(1), ""),
        (picture(1), None, ""),
        (picture(1), picture(1), "came again: the stream is stale"),
        (picture(2, seed=1), picture(1), "the stream is frozen"),
        (picture(1, level=2), None, "black"),
        (picture(1, valid=0.1), None, "10% of the depth is valid, expected at least 30%"),
    ],
)
def test_what_is_wrong_with_a_picture(now: Picture, before: Picture | None, part: str) -> None:
    last = None if before is None else (before.number, before.timestamp_ms, digest(before))
    said = picture_fault(now, digest(now), last, 0.3)
    assert said == part or (part and part in said)


def test_depth_out_of_range_is_a_hole_and_holes_are_filled() -> None:
    raw = np.full((40, 40), 500, np.uint16)
    raw[10:14, 10:14] = 0
    raw[20, 20], raw[30, 30] = 50, 4000
    filled, valid = filled_depth(raw, 0.001, 0.1, 1.0)
    assert valid == pytest.approx(1 - 18 / 1600)
    assert np.abs(filled.astype(int) - 500).max() <= 2
    assert raw[20, 20] == 50
    nothing, none_valid = filled_depth(np.zeros((4, 4), np.uint16), 0.001, 0.1, 1.0)
    assert (none_valid, nothing.max()) == (0.0, 0)


class Child:
    """A camera's child that gives pictures again once it was helped as it needs."""

    def __init__(self, cure: str, fault: Callable[[], Picture]) -> None:
        self.cure, self.fault = cure, fault
        self.did: list[str] = []
        self.number = 0

    def ask(self, method: str, *_: object, timeout_s: float) -> Picture | None:
        if method != "picture":
            self.did.append(method)
            return None
        self.number += 1
        return picture(self.number) if self.cure in ("", *self.did) else self.fault()

    def kill(self) -> None:
        self.did.append("kill")

    def start(self) -> None:
        self.did.append("start")


def lost() -> Picture:
    raise DeviceLostError("camera: no frame within 1 s")


def camera_with(child: Child, config: CameraConfig = CONFIG) -> tuple[Camera, list[str]]:
    told: list[str] = []
    camera = Camera(config, note=told.append)
    camera.child = child  # type: ignore[assignment]
    return camera, told


@pytest.mark.parametrize(
    ("cure", "did"),
    [
        ("", []),
        ("restart", ["restart"]),
        ("hardware_reset", ["restart", "hardware_reset"]),
        ("start", ["restart", "hardware_reset", "kill", "start"]),
    ],
)
def test_the_ladder_goes_as_far_as_it_must(cure: str, did: list[str]) -> None:
    child = Child(cure, lost)
    camera, told = camera_with(child)
    assert camera.picture().rgb.shape == (8, 8, 3)
    assert child.did == did
    assert len(told) == (0 if not did else len([step for step in did if step != "kill"]) + 1)


@pytest.mark.parametrize(
    "fault", [lost, lambda: picture(9, level=0), lambda: picture(9, valid=0.0)], ids=["lost", "black", "no depth"]
)
def test_a_picture_that_nothing_brings_back_is_told_with_its_fault(fault: Callable[[], Picture]) -> None:
    camera, told = camera_with(Child("never", fault))
    with pytest.raises(DeviceLostError, match="no usable picture"):
        camera.picture()
    assert len(told) == 5


def test_the_operators_command_is_the_last_step(tmp_path: Path) -> None:
    flag = tmp_path / "switched"
    command = (sys.executable, "-c", f"open({str(flag)!r}, 'w').close()")
    child = Child("start", lost)
    child.start = lambda: child.did.append("start" if flag.exists() else "started too early")  # type: ignore[method-assign]
    camera, _ = camera_with(child, CameraConfig(kind="emulated", address="127.0.0.3", power_cycle=command))
    assert camera.picture().number > 0
    assert flag.exists()


def need_realsense() -> None:
    if find_spec("pyrealsense2") is None:
        pytest.skip("pyrealsense2 is not installed: pip install 'handsight[ur10]'")
    usable = subprocess.run([sys.executable, "-c", "import pyrealsense2"], capture_output=True, text=True, check=False)
    if usable.returncode:
        pytest.skip(f"pyrealsense2 cannot be imported, apt-get install libusb-1.0-0: {usable.stderr[-80:]}")


def test_a_recording_goes_the_way_of_the_device(tmp_path: Path) -> None:
    """Real pyrealsense2 in the real child, on a .db3 file: pictures until it ends, then an error and no hang."""
    need_realsense()
    file = tmp_path / "table.db3"
    recorder = [sys.executable, "-m", "handsight.collection.ur10.emulator.recording"]
    with running_rig("--objects", "blocks-test", "--objects-per-scene", "1", camera=True) as rig:
        subprocess.run([*recorder, rig.camera, str(file), "--frames", "4"], check=True, timeout=60)
    camera = Camera(CameraConfig(kind="recording", file=str(file), timeout_s=2.0))
    try:
        assert camera.description().serial == "934222071234"
        shown = camera.picture()
        assert (shown.rgb.shape, shown.depth.shape) == ((480, 640, 3), (480, 640))
        assert 0.001 * float(np.median(shown.depth)) == pytest.approx(0.6, abs=0.01)
        assert shown.depth.min() > 0
    finally:
        camera.close()


def test_another_camera_than_the_rigs_is_refused() -> None:
    need_realsense()
    with running_rig("--objects", "blocks-test", "--objects-per-scene", "1", camera=True) as rig:
        camera = Camera(CameraConfig(kind="emulated", address=rig.camera, serial="42"))
        with pytest.raises(DeviceError, match="has serial number 934222071234, and rig"):
            camera.description()
