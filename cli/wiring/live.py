"""``--live``: a viewer that watches servo runs, and is gone without where there can be none."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from handsight.cli.errors import CommandError
from handsight.cli.output import console, errors
from handsight.viz.browser.display import check_display
from handsight.viz.errors import ViewerError

if TYPE_CHECKING:
    import subprocess

    from handsight.viz.recordings.live import LiveFactory

MEMORY_LIMIT = "2GB"


def check_live(*, live: bool, url: str | None) -> None:
    """Refuse options of which no viewer follows, before anything is opened.

    Raises:
        CommandError: A viewer of our own and another are both asked for.
        ViewerError: The address is none.
    """
    if url is None:
        return
    if live:
        raise CommandError("--live opens a viewer and --live-url names another, expected one of them")
    from handsight.viz.live_url import check_live_url

    check_live_url(url)


@contextmanager
def live_watch(*, live: bool, url: str | None) -> Iterator[LiveFactory | None]:
    """Who watches the trials of the block; None where nobody does.

    A viewer of our own ends with the block, once its window was closed where somebody sits before it.
    """
    if url is not None:
        yield _factory(url)
    elif not live:
        yield None
    else:
        with _own_viewer() as opened:
            if opened is None:
                yield None
                return
            process, own_url = opened
            yield _factory(own_url)
            if sys.stdout.isatty():
                console.print("close the viewer's window or press Ctrl-C to end")
                with suppress(KeyboardInterrupt):
                    process.wait()


@contextmanager
def _own_viewer() -> Iterator[tuple[subprocess.Popen[bytes], str] | None]:
    """A window on this machine and its address; None, after a warning, where there can be none."""
    from handsight.viz.errors import ScreenshotError

    try:
        check_display("--live-url shows the run in a viewer elsewhere")
    except ViewerError as error:
        warn(f"{error}; servoing goes on without a viewer")
        yield None
        return
    from handsight.viz.recordings.viewer_process import free_port, running_viewer

    port = free_port()
    arguments = ["--bind", "127.0.0.1", "--port", str(port), "--memory-limit", MEMORY_LIMIT, "--hide-welcome-screen"]
    viewer = running_viewer(arguments, port)
    try:
        process = viewer.__enter__()
    except ScreenshotError as error:
        warn(f"{error}; servoing goes on without a viewer")
        yield None
        return
    try:
        yield process, f"rerun+http://127.0.0.1:{port}/proxy"
    finally:
        viewer.__exit__(None, None, None)


def _factory(url: str) -> LiveFactory:
    from handsight.collection.sim.arm_shape import Ur10Shape
    from handsight.viz.recordings.live import LiveFactory

    return LiveFactory(url=url, arm=Ur10Shape(), warn=warn)


def warn(text: str) -> None:
    """A line on standard error about something that the work goes on without."""
    errors.print(f"warning: {text}")
