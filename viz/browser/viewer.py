"""Rerun's viewer as a process of its own: in a window, or served to a browser on this machine."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from urllib.parse import quote

from rerun.experimental import ViewerClient

from handsight.viz.browser.display import check_display
from handsight.viz.browser.page import serve_page
from handsight.viz.errors import ViewerError
from handsight.viz.recordings.viewer_process import free_port, running_viewer

MEMORY_LIMIT = "2GB"


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenViewer:
    """A viewer that runs."""

    process: subprocess.Popen[bytes]
    port: int
    """Where it listens for what to show."""
    page: str = ""
    """What to open in a web browser; empty where the viewer has a window of its own."""

    def show(self, address: str) -> None:
        """Have a viewer with a window of its own show another address.

        Raises:
            ViewerError: It was closed, or does not answer.
        """
        try:
            ViewerClient.connect(f"rerun+http://127.0.0.1:{self.port}/proxy").open(address)
        except (ConnectionError, TimeoutError) as error:
            raise ViewerError(
                "the viewer was closed or does not answer; what was decided is kept, the same call opens another"
            ) from error


@contextmanager
def native_viewer(address: str) -> Iterator[OpenViewer]:
    """A window that shows an address, and ends with the block.

    Raises:
        ViewerError: It did not start.
    """
    check_display()
    port = free_port()
    arguments = [address, "--bind", "127.0.0.1", "--port", str(port)]
    arguments += ["--memory-limit", MEMORY_LIMIT, "--hide-welcome-screen"]
    with running_viewer(arguments, port) as process:
        yield OpenViewer(process=process, port=port)


@contextmanager
def web_viewer(address: str, *, host: str = "127.0.0.1", port: int = 0) -> Iterator[OpenViewer]:
    """A page that shows an address in a web browser, served until the block ends.

    Args:
        address: What it shows.
        host: Where the page is served; nobody but this machine unless told otherwise.
        port: Of the page; 0 for any free one.

    Raises:
        ViewerError: The server did not start, as where the port is in use.
    """
    inner_port, grpc_port = free_port(), free_port()
    arguments = ["--serve-web", address, "--bind", "127.0.0.1", "--port", str(grpc_port)]
    with (
        running_viewer([*arguments, "--web-viewer-port", str(inner_port)], inner_port) as process,
        serve_page(inner_port, host=host, port=port) as page_port,
    ):
        page = f"http://{host}:{page_port}/?url={quote(address, safe='')}"
        yield OpenViewer(process=process, port=grpc_port, page=page)
