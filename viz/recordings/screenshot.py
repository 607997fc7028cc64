"""Pictures of recordings without a window, for documents and tests.

Rerun's viewer draws with Vulkan; a software driver will do. It goes on loading a recording and decoding its pictures
while it already draws, so a screenshot counts only once two in a row look the same.
"""

from __future__ import annotations

import io
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from rerun.experimental import ViewerClient

from handsight.jobs.processes import bound_command
from handsight.viz.errors import NoVulkanError, ScreenshotError

NO_VULKAN_SIGNS = ("No graphics adapter", "Failed to get render context")
QUIET = {"RERUN_APP_ONLY": "true", "RUST_LOG": "error"}
"""No question about analytics, and no notices over the picture."""
MEMORY_LIMIT = "1GB"
START_LIMIT_S = 30.0
PICTURE_LIMIT_S = 90.0
POLL_S = 0.1
BETWEEN_SHOTS_S = 0.6
SAME_PICTURE_LEVELS = 0.02
"""Pictures whose grey levels differ less than this on average are the same."""
THUMBNAIL = (480, 270)

Answer = TypeVar("Answer")


def save_screenshots(recording: Path, shots: Mapping[int, Path], *, timeline: str) -> None:
    """Save pictures of the viewer, 1920x1080 PNG, at some steps of a recording.

    Args:
        recording: The ``.rrd``; its own layout is shown.
        shots: Where to save the picture of each step.
        timeline: The timeline on which the steps are counted.

    Raises:
        ScreenshotError: There is no such recording, or the viewer showed no steady picture, or it reported that a view
            could not be drawn.
        NoVulkanError: The viewer found no graphics driver.
    """
    if not recording.is_file():
        raise ScreenshotError(f"there is no recording at {str(recording)!r}, expected an .rrd file")
    with _viewer() as viewer:
        _open(viewer, recording)
        for step, path in shots.items():
            _show(viewer, timeline, step)
            path.write_bytes(_steady_picture(viewer))
        state = patiently(viewer.get_state, time.monotonic() + PICTURE_LIMIT_S, "say what it drew")
        reports = [f"{view.name}: {view.reports}" for view in state.views if view.reports]
    if reports:
        raise ScreenshotError(f"the viewer could not draw {recording.name} as intended: {'; '.join(reports)}")


@contextmanager
def _viewer() -> Iterator[ViewerClient]:
    """A headless viewer, reachable from this machine only, that ends with the block whatever happens in it."""
    port = _free_port()
    command = [str(_viewer_binary()), "--headless", "--hide-welcome-screen", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--memory-limit", MEMORY_LIMIT]
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(bound_command(command), stdout=log, stderr=log, env={**os.environ, **QUIET})
        try:
            _wait_until_listening(process, port, log)
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        except ConnectionError as error:
            raise _diagnosis(log) from error
        finally:
            process.kill()
            process.wait()


def _viewer_binary() -> Path:
    """The viewer itself: the command ``rerun`` is a wrapper, and killing it leaves the viewer running."""
    package = find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise ScreenshotError(
            "the package rerun_cli is missing, expected it to come with rerun-sdk; reinstall rerun-sdk"
        )
    return Path(package.origin).with_name("rerun")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _wait_until_listening(process: subprocess.Popen[bytes], port: int, log: io.BufferedRandom) -> None:
    deadline = time.monotonic() + START_LIMIT_S
    while process.poll() is None and time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(POLL_S)
    raise _diagnosis(log)


def _diagnosis(log: io.BufferedRandom) -> ScreenshotError:
    log.seek(0)
    said = log.read().decode(errors="replace")
    if any(sign in said for sign in NO_VULKAN_SIGNS):
        return NoVulkanError(
            "the Rerun viewer found no Vulkan driver to draw with; install one "
            "(Debian and Ubuntu: apt-get install mesa-vulkan-drivers)"
        )
    last = said.strip().splitlines()[-1:] or ["nothing"]
    return ScreenshotError(f"the Rerun viewer did not start or went away; the last it said was: {last[0]}")


def _open(viewer: ViewerClient, recording: Path) -> None:
    what, deadline = f"load {recording.name}", time.monotonic() + PICTURE_LIMIT_S
    opened = patiently(lambda: viewer.open(str(recording.resolve())), deadline, what)
    while True:
        state = patiently(viewer.get_state, deadline, what)
        if not state.loading and any(shown.store_id in opened.store_ids for shown in state.recordings):
            return
        time.sleep(POLL_S)


def _show(viewer: ViewerClient, timeline: str, step: int) -> None:
    def ask() -> None:
        viewer.set_time(timeline, sequence=step, play_state="paused")

    patiently(ask, time.monotonic() + PICTURE_LIMIT_S, f"go to step {step}")


def _steady_picture(viewer: ViewerClient) -> bytes:
    deadline = time.monotonic() + PICTURE_LIMIT_S
    before: NDArray[np.float32] | None = None
    while True:
        png = patiently(viewer.take_screenshot, deadline, "show a picture at rest")
        now = _thumbnail(png)
        if before is not None and float(np.abs(now - before).mean()) < SAME_PICTURE_LEVELS:
            return png
        before = now
        time.sleep(BETWEEN_SHOTS_S)


def patiently(ask: Callable[[], Answer], deadline: float, what: str) -> Answer:
    """What the viewer answers, asked again where the client gave up on a busy viewer, until our own limit.

    Args:
        ask: Asks once; a viewer that draws with the processor may need longer than the client waits for.
        deadline: Until when to ask, in seconds of the monotonic clock.
        what: What the viewer was to do, for the message.

    Raises:
        ScreenshotError: The time is over.
    """
    while time.monotonic() < deadline:
        with suppress(TimeoutError):
            return ask()
    raise ScreenshotError(
        f"the viewer did not {what} within {PICTURE_LIMIT_S:.0f} s, expected it to: try again on an idle machine"
    )


def _thumbnail(png: bytes) -> NDArray[np.float32]:
    grey = cv2.imdecode(np.frombuffer(png, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    if grey is None:
        raise ScreenshotError(f"the viewer sent {len(png)} bytes that are no picture, expected a PNG")
    return cv2.resize(grey, THUMBNAIL, interpolation=cv2.INTER_AREA).astype(np.float32)
