"""Whoever is told, outside the rig's machine, that the rig has paused: a webhook on loopback."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread


class Alarms(ThreadingHTTPServer):
    """Keeps the text of every alarm."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Hook)
        self.heard: list[str] = []

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/"


class _Hook(BaseHTTPRequestHandler):
    server: Alarms

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.heard.append(json.loads(body)["text"])
        self.send_response(204)
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@contextmanager
def listening() -> Iterator[Alarms]:
    """A webhook for the block."""
    with Alarms() as alarms:
        thread = Thread(target=alarms.serve_forever, daemon=True)
        thread.start()
        try:
            yield alarms
        finally:
            alarms.shutdown()
            thread.join()
