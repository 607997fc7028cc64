"""A page in a headless web browser that is watched: what it says to its console, whom it asks, how it looks.

Chromium speaks its DevTools protocol over two pipes as well as over a socket, so that no more than JSON is needed: each
message ends in a zero byte.
"""

from __future__ import annotations

import base64
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from tests.support.chromium import browser_call

LIMIT_S = 120.0
"""So long a page may take for anything: software draws it, on a machine that may be busy."""
# The protocol's pipes are those of the numbers 3 and 4; both are copied first, as one may have the other's number.
_PIPES = """
import fcntl, os, sys
for number, pipe in zip((3, 4), [fcntl.fcntl(int(text), fcntl.F_DUPFD, 10) for text in sys.argv[1:3]]):
    os.dup2(pipe, number)
os.execvp(sys.argv[3], sys.argv[3:])
"""
# Pictures in three dimensions without a graphics card.
SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_BEGIN = ("Runtime.enable", "Log.enable", "Network.enable", "Page.enable")


@dataclass
class WatchedPage:
    """A tab, and what was heard of it."""

    said: list[str] = field(default_factory=list)
    """Errors in its console, its exceptions among them."""
    requests: list[str] = field(default_factory=list)
    """Addresses that it asked for, whatever came of it; not ``data:``, ``blob:`` and files, which ask nobody."""
    _to: int = -1
    _from: int = -1
    _session: str = ""
    _number: int = 0
    _rest: bytes = b""
    _answers: dict[int, dict[str, Any]] = field(default_factory=dict)

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """Ask the browser for something, and return what it answers."""
        self._number += 1
        number = self._number
        message: dict[str, Any] = {"id": number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        self.wait_until(lambda: number in self._answers, method)
        answer = self._answers.pop(number)
        assert "error" not in answer, f"{method}: {answer['error']}"
        result: dict[str, Any] = answer["result"]
        return result

    def wait_until(self, holds: Callable[[], bool], what: str) -> None:
        """Listen to the page until something holds, which is asked again whenever it says something, and often."""
        until = time.monotonic() + LIMIT_S
        while not holds():
            assert time.monotonic() < until, f"{what} took longer than {LIMIT_S:g} s; the page said {self.said}"
            if select.select([self._from], [], [], 0.2)[0]:
                self._hear()

    def screenshot(self, path: Path) -> Path:
        """The page as it looks, as a PNG."""
        path.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"]))
        return path

    def elsewhere(self) -> list[str]:
        """The requests that left this machine, or would have."""
        return [url for url in self.requests if urlsplit(url).hostname not in _LOOPBACK]

    def _hear(self) -> None:
        piece = os.read(self._from, 1 << 20)
        assert piece, "the browser has ended"
        *whole, self._rest = (self._rest + piece).split(b"\0")
        for text in whole:
            message = json.loads(text)
            if "id" in message:
                self._answers[message["id"]] = message
            else:
                self._note(message["method"], message.get("params", {}))

    def _note(self, event: str, params: dict[str, Any]) -> None:
        if event == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
            self.said.append(" ".join(str(one.get("value", one.get("description"))) for one in params["args"]))
        elif event == "Runtime.exceptionThrown":
            self.said.append(json.dumps(params["exceptionDetails"]))
        elif event == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.said.append(f"{params['entry']['text']} {params['entry'].get('url', '')}")
        elif event == "Network.requestWillBeSent":
            url = params["request"]["url"]
            if not url.startswith(("data:", "blob:", "file:")):
                self.requests.append(url)


@contextmanager
def watched_page(url: str, folder: Path, *options: str) -> Iterator[WatchedPage]:
    """Open a page in a browser of its own, whose profile is in ``folder``; it ends with the block."""
    theirs_in, to = os.pipe()
    back, theirs_out = os.pipe()
    call = browser_call(folder, "--remote-debugging-pipe", *options)
    started = [sys.executable, "-I", "-S", "-c", _PIPES, str(theirs_in), str(theirs_out), *call, "about:blank"]
    log = folder / "browser.log"
    with (
        log.open("wb") as output,
        subprocess.Popen(
            started,
            pass_fds=(theirs_in, theirs_out),
            stdout=output,
            stderr=output,
            env={**os.environ, "HOME": str(folder)},
            start_new_session=True,
        ) as browser,
    ):
        for end in (theirs_in, theirs_out):
            os.close(end)
        try:
            page = WatchedPage(_to=to, _from=back)
            _begin(page, url)
            yield page
        finally:
            os.killpg(browser.pid, 9)
            for end in (to, back):
                os.close(end)


def _begin(page: WatchedPage, url: str) -> None:
    tabs = page.ask("Target.getTargets")["targetInfos"]
    (tab,) = (one["targetId"] for one in tabs if one["type"] == "page")
    page._session = page.ask("Target.attachToTarget", targetId=tab, flatten=True)["sessionId"]
    for method in _BEGIN:
        page.ask(method)
    opened = page.ask("Page.navigate", url=url)
    assert "errorText" not in opened, f"{url}: {opened['errorText']}"
