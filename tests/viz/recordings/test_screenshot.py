"""Recordings in the real viewer, without a window: every view draws, and reports nothing."""

from __future__ import annotations

import os
import select
import sys
import time
from pathlib import Path
from subprocess import PIPE, Popen
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.support.rrd import colours, read_picture

from handsight.evaluation.trial import TrialRecording
from handsight.viz.errors import NoVulkanError, ScreenshotError
from handsight.viz.examples import HeatmapExample
from handsight.viz.recordings import screenshot
from handsight.viz.recordings.heatmap_layouts import HEAT_TIMELINE
from handsight.viz.recordings.heatmaps import write_heatmaps
from handsight.viz.recordings.screenshot import patiently, save_screenshots, steady_picture


def shoot(recording: Path, shots: dict[int, Path], timeline: str) -> list[NDArray[Any]]:
    try:
        save_screenshots(recording, shots, timeline=timeline)
    except NoVulkanError as error:
        pytest.skip(str(error))
    return [read_picture(path) for path in shots.values()]


def test_a_servo_trace_draws_at_its_first_and_last_step(
    trace_path: Path, trial: TrialRecording, tmp_path: Path
) -> None:
    last = len(trial.trace.steps) - 1
    first_picture, last_picture = shoot(
        trace_path, {0: tmp_path / "first.png", last: tmp_path / "last.png"}, "servo_step"
    )
    for picture in (first_picture, last_picture):
        height, width = picture.shape[:2]
        # Scene, pictures and plots each lie in a part of their own: none of them may be blank.
        upper, lower = picture[: int(0.62 * height)], picture[int(0.68 * height) :]
        assert colours(upper[:, : width // 3]) > 500
        assert colours(upper[:, int(0.36 * width) : int(0.66 * width)]) > 2000
        assert colours(upper[: height // 3, int(0.68 * width) : int(0.82 * width)]) > 100
        assert colours(upper[: height // 3, int(0.85 * width) :]) > 500
        for start in (0.0, 0.22, 0.41, 0.56):
            assert colours(lower[:, int(start * width) : int((start + 0.13) * width)]) > 30
        assert colours(lower[:, int(0.71 * width) :]) > 100
    assert np.abs(first_picture.astype(int) - last_picture).mean() > 1


PARTS = {
    "at this angle": (slice(0.07, 0.50), slice(0.01, 0.31)),
    "over all angles": (slice(0.07, 0.50), slice(0.34, 0.64)),
    "the angle of the best": (slice(0.07, 0.50), slice(0.68, 0.98)),
    "over depth": (slice(0.60, 0.92), slice(0.03, 0.27)),
    "on the table": (slice(0.60, 0.95), slice(0.32, 0.58)),
    "the attempted grasp": (slice(0.58, 0.74), slice(0.62, 0.78)),
    "the text": (slice(0.80, 0.96), slice(0.60, 0.85)),
}
"""Rows and columns of each view of an example, as shares of the window."""


def part(picture: NDArray[Any], name: str) -> NDArray[Any]:
    rows, columns = (
        slice(int(share.start * side), int(share.stop * side))
        for share, side in zip(PARTS[name], picture.shape[:2], strict=True)
    )
    return picture[rows, columns]


def test_heatmaps_draw_every_view_at_every_angle_and_follow_the_slider(
    examples: list[HeatmapExample], tmp_path: Path
) -> None:
    write_heatmaps(tmp_path / "heatmaps.rrd", examples[1:])
    shots = {0: tmp_path / "straight.png", 150: tmp_path / "turned.png"}
    straight, turned = shoot(tmp_path / "heatmaps.rrd", shots, HEAT_TIMELINE)
    for picture in (straight, turned):
        for name in PARTS:
            assert colours(part(picture, name)) > (30 if name == "the text" else 500), name
    moved = {name: np.abs(part(straight, name).astype(int) - part(turned, name)).mean() for name in PARTS}
    for name in ("at this angle", "over depth", "on the table"):
        assert moved[name] > 0.2, name
    for name in ("over all angles", "the angle of the best", "the attempted grasp", "the text"):
        assert moved[name] < 0.05, name


def test_without_a_driver_the_package_to_install_is_named(
    trace_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable in ("VK_ICD_FILENAMES", "VK_DRIVER_FILES"):
        monkeypatch.setenv(variable, str(tmp_path / "no-driver.json"))
    with pytest.raises(NoVulkanError, match="apt-get install mesa-vulkan-drivers"):
        save_screenshots(trace_path, {0: tmp_path / "shot.png"}, timeline="servo_step")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_recording_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ScreenshotError, match=r"expected an \.rrd file"):
        save_screenshots(tmp_path / "none.rrd", {}, timeline="servo_step")


SHOOTER = """
import os, sys
from pathlib import Path
from handsight.viz.recordings.screenshot import headless_viewer
with headless_viewer():
    (viewer,) = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    print(viewer, flush=True)
    sys.stdin.read()
"""


def test_the_viewer_ends_with_a_killed_command() -> None:
    with Popen([sys.executable, "-P", "-c", SHOOTER], stdin=PIPE, stdout=PIPE, stderr=PIPE, text=True) as command:
        assert command.stdout is not None
        assert command.stderr is not None
        viewer = command.stdout.readline()
        if not viewer:
            said = command.stderr.read()
            assert "NoVulkanError" in said, said
            pytest.skip(said.splitlines()[-1])
        gone = select.poll()
        gone.register(os.pidfd_open(int(viewer)), select.POLLIN)
        command.kill()
    assert gone.poll(60_000), "the viewer goes on without its command"


def test_a_client_that_gives_up_is_asked_again() -> None:
    answers: list[TimeoutError | bytes] = [TimeoutError("busy"), TimeoutError("busy"), b"png"]

    def ask() -> bytes:
        answer = answers.pop(0)
        if isinstance(answer, TimeoutError):
            raise answer
        return answer

    assert patiently(ask, time.monotonic() + 60, "show a picture") == b"png"
    assert answers == []


def test_the_limit_ends_in_an_error_of_this_room() -> None:
    asked = []

    def ask() -> None:
        asked.append(1)
        raise TimeoutError("busy")

    with pytest.raises(ScreenshotError, match="did not show a picture within"):
        patiently(ask, time.monotonic() + 0.05, "show a picture")
    assert asked


class BusyViewer:
    """Draws for two seconds, and has the last of its pictures after five."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s

    def take_screenshot(self) -> bytes:
        whole = self.now_s >= 5.0
        self.now_s += 2.0
        return cv2.imencode(".png", np.full((270, 480), 200 if whole else 100, np.uint8))[1].tobytes()


def test_a_busy_viewer_is_given_time_to_load(monkeypatch: pytest.MonkeyPatch) -> None:
    viewer = BusyViewer()
    monkeypatch.setattr(screenshot, "time", SimpleNamespace(monotonic=viewer.monotonic, sleep=viewer.sleep))
    png = np.frombuffer(steady_picture(viewer.take_screenshot), np.uint8)
    picture = cv2.imdecode(png, cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert picture[0, 0] == 200
