"""Pictures of recordings without a window, for documents and tests.

Rerun's viewer draws with Vulkan; a software driver will do. It goes on loading a recording and decoding its pictures
while it already draws, so a screenshot counts only once two in a row look the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from rerun.experimental import ViewerClient

from handsight.viz.errors import ScreenshotError
from handsight.viz.recordings.viewer_process import free_port, running_viewer

MEMORY_LIMIT = "1GB"
PICTURE_LIMIT_S = 90.0
POLL_S = 0.1
BETWEEN_SHOTS_S = 0.6
MOST_BETWEEN_SHOTS_S = 5.0
"""Far below the limit, which a viewer that is asked several times for a picture comes near to."""
DRAWN_BETWEEN_SHOTS = 2.0
"""How many pictures a viewer could draw meanwhile, unless it is slower than that."""
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
    with headless_viewer() as viewer:
        _open(viewer, recording)
        for step, path in shots.items():
            _show(viewer, timeline, step)
            path.write_bytes(steady_picture(viewer.take_screenshot))
        state = patiently(viewer.get_state, time.monotonic() + PICTURE_LIMIT_S, "say what it drew")
        reports = [f"{view.name}: {view.reports}" for view in state.views if view.reports]
    if reports:
        raise ScreenshotError(f"the viewer could not draw {recording.name} as intended: {'; '.join(reports)}")


def save_address_picture(address: str, path: Path) -> None:
    """Save a picture of the viewer, 1920x1080 PNG, once what an address shows is there.

    Args:
        address: What the viewer opens: ``rerun+http://...``.
        path: The file to write.

    Raises:
        ScreenshotError: The viewer showed no steady picture.
        NoVulkanError: The viewer found no graphics driver.
    """
    with headless_viewer() as viewer:
        patiently(lambda: viewer.open(address), time.monotonic() + PICTURE_LIMIT_S, f"open {address}")
        while patiently(viewer.get_state, time.monotonic() + PICTURE_LIMIT_S, "load what it shows").loading:
            time.sleep(POLL_S)
        # Cards ask for their pictures only once they are drawn.
        steady_picture(viewer.take_screenshot)
        time.sleep(BETWEEN_SHOTS_S)
        path.write_bytes(steady_picture(viewer.take_screenshot))


@contextmanager
def headless_viewer() -> Iterator[ViewerClient]:
    """A headless viewer, reachable from this machine only, that ends with the block whatever happens in it."""
    port = free_port()
    arguments = ["--headless", "--hide-welcome-screen", "--bind", "127.0.0.1", "--port", str(port)]
    with running_viewer([*arguments, "--memory-limit", MEMORY_LIMIT], port):
        yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")


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


def steady_picture(take: Callable[[], bytes]) -> bytes:
    """The PNG that a viewer shows once it shows the same as before; ``take`` asks it for what it shows.

    Raises:
        ScreenshotError: It never does.
    """
    deadline = time.monotonic() + PICTURE_LIMIT_S
    before: NDArray[np.float32] | None = None
    while True:
        asked_s = time.monotonic()
        png = patiently(take, deadline, "show a picture at rest")
        took_s = time.monotonic() - asked_s
        now = _thumbnail(png)
        if before is not None and float(np.abs(now - before).mean()) < SAME_PICTURE_LEVELS:
            return png
        before = now
        # A viewer that is slow to draw, on a busy machine, is slow to load what it draws as well.
        time.sleep(min(max(BETWEEN_SHOTS_S, DRAWN_BETWEEN_SHOTS * took_s), MOST_BETWEEN_SHOTS_S))


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
