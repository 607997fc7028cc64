"""A web browser without a screen, where one is installed: what a page says to it, and what it asks the network for."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
WAIT_S = 120
QUIET = (
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-extensions",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    # What the browser itself would ask its maker finds no way out; nor would the page.
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)


@dataclass(frozen=True)
class Visit:
    """What came of opening a page."""

    text: str
    """The page as the browser holds it."""
    console: list[str]
    """What the page wrote to the console."""
    requests: list[str]
    """Addresses that were asked for, beyond the page itself and ``data:``."""


def chromium() -> str:
    """Path of a browser; skips where there is none."""
    found = next((path for name in NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no Chromium to open pages with: apt-get install chromium")
    return found


def browser_call(folder: Path, *options: str) -> list[str]:
    """The command of a browser without a window, with its own profile in ``folder``."""
    call = [chromium(), "--headless=new", *QUIET, f"--user-data-dir={folder / 'profile'}", *options]
    if os.geteuid() == 0:
        call.append("--no-sandbox")  # Chromium refuses to be root otherwise.
    return call


def visit(page: Path, folder: Path, *, width_px: int, dark: bool = False) -> Visit:
    """Open a page, with its own profile in ``folder``."""
    log = folder / "net.json"
    done = _run(page, folder, width_px, "--dump-dom", f"--log-net-log={log}", "--enable-logging=stderr", dark=dark)
    console = [line.partition("CONSOLE")[2] for line in done.stderr.splitlines() if "CONSOLE" in line]
    return Visit(done.stdout, console, _requests(log))


def picture(page: Path, folder: Path, *, width_px: int, height_px: int = 1600, dark: bool = False) -> Path:
    """The top of a page as it looks, as a PNG."""
    shot = folder / f"{page.stem}-{width_px}{'-dark' * dark}.png"
    _run(page, folder, width_px, f"--screenshot={shot}", height_px=height_px, dark=dark)
    return shot


def _run(
    page: Path, folder: Path, width_px: int, *options: str, height_px: int = 1600, dark: bool
) -> subprocess.CompletedProcess[str]:
    call = browser_call(folder, f"--window-size={width_px},{height_px}", "--disable-gpu", *options)
    if dark:
        call.append("--force-dark-mode")
    done = subprocess.run(
        [*call, page.as_uri()],
        capture_output=True,
        text=True,
        check=False,
        timeout=WAIT_S,
        env={**os.environ, "HOME": str(folder)},
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done


def _requests(log: Path) -> list[str]:
    """Addresses in the log of the network stack that a page asked for; what the browser asks has no origin."""
    events = [event.get("params", {}) for event in json.loads(log.read_text())["events"]]
    asked = [
        str(params["url"])
        for params in events
        if "url" in params and params.get("initiator", "not an origin") != "not an origin"
    ]
    return sorted({url for url in asked if not url.startswith(("data:", "file:"))})
