"""The program of Rerun's viewer: where it is, how it is started quietly, and why it did not start."""

from __future__ import annotations

import io
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from handsight.datasets.held import HeldFolder
from handsight.jobs.processes import bound_command
from handsight.viz.errors import NoVulkanError, ScreenshotError

NO_VULKAN_SIGNS = ("No graphics adapter", "Failed to get render context")
START_LIMIT_S = 30.0
POLL_S = 0.1
_FORCED = "FORCE_RERUN_ANALYTICS"


@contextmanager
def running_viewer(arguments: Sequence[str], port: int) -> Iterator[subprocess.Popen[bytes]]:
    """The viewer's program, which ends with the block whatever happens in it, and leaves nothing behind.

    Args:
        arguments: What it is called with.
        port: Where it listens once it is ready.

    Raises:
        ScreenshotError: It ended at once, or took too long, or went away during the block.
        NoVulkanError: It found no graphics driver.
    """
    # A viewer that is killed leaves the folder of its catalog where temporary files go.
    with HeldFolder("handsight-viewer-") as folder, tempfile.TemporaryFile() as log:
        command = bound_command([str(viewer_binary()), *arguments])
        environment = {**viewer_environment(), "TMPDIR": str(folder)}
        process = subprocess.Popen(command, stdout=log, stderr=log, env=environment)
        try:
            wait_until_listening(process, port, log)
            yield process
        except ConnectionError as error:
            raise viewer_diagnosis(log) from error
        finally:
            process.kill()
            process.wait()


def viewer_environment() -> dict[str, str]:
    """The environment of a viewer: no notices over the picture, and no analytics unless the user asks for them.

    The viewer sends none where it believes that a machine runs it. Somebody who wants them sets the variable that Rerun
    has for it.
    """
    quiet = {"RERUN_APP_ONLY": "true", "RUST_LOG": "error"}
    return {**os.environ, **quiet, **({} if _FORCED in os.environ else {"CI": "true"})}


def viewer_binary() -> Path:
    """The viewer itself: the command ``rerun`` is a wrapper, and killing it leaves the viewer running."""
    package = find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise ScreenshotError(
            "the package rerun_cli is missing, expected it to come with rerun-sdk; reinstall rerun-sdk"
        )
    return Path(package.origin).with_name("rerun")


def free_port() -> int:
    """A port of the loopback that nobody listens at now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def wait_until_listening(process: subprocess.Popen[bytes], port: int, log: io.BufferedRandom) -> None:
    """Wait until the program listens at a port.

    Raises:
        ScreenshotError: It ended, or took too long.
        NoVulkanError: It found no graphics driver.
    """
    deadline = time.monotonic() + START_LIMIT_S
    while process.poll() is None and time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(POLL_S)
    raise viewer_diagnosis(log)


def viewer_diagnosis(log: io.BufferedRandom) -> ScreenshotError:
    """What the program said on its way out, as an error."""
    log.seek(0)
    said = log.read().decode(errors="replace")
    if any(sign in said for sign in NO_VULKAN_SIGNS):
        return NoVulkanError(
            "the Rerun viewer found no Vulkan driver to draw with; install one "
            "(Debian and Ubuntu: apt-get install mesa-vulkan-drivers)"
        )
    last = said.strip().splitlines()[-1:] or ["nothing"]
    return ScreenshotError(f"the Rerun viewer did not start or went away; the last it said was: {last[0]}")
