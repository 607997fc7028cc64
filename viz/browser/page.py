"""The page of Rerun's web viewer, kept from asking anybody but this machine.

The page that Rerun serves fetches fonts, its own news and its analytics from elsewhere, whatever the user has said of
them. This one is the same but for that: links that lead elsewhere are taken out, a request that does not go to this
machine is answered on the page itself with nothing, and the browser is told to refuse what got past that.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import ClassVar
from urllib.error import HTTPError, URLError
from urllib.request import urlopen

from handsight.viz.errors import ViewerError

LIMIT_S = 30.0
_ELSEWHERE = re.compile(rb"<link\b[^>]*\bhref=\"https?://[^>]*>", re.DOTALL)
_HEAD = b"<head>"
# Telemetry of the catalog's own kind is asked for on this machine, and nobody answers it there.
_STAY_HERE = b"""<head>
    <script>
      (() => {
        const ask = window.fetch.bind(window);
        const here = new Set(["127.0.0.1", "localhost", location.hostname]);
        window.fetch = (what, ...rest) => {
          const url = new URL(what instanceof Request ? what.url : what, location.href);
          const silent = !here.has(url.hostname) || url.pathname.includes("opentelemetry");
          return silent ? Promise.resolve(new Response("{}", { status: 200 })) : ask(what, ...rest);
        };
      })();
    </script>"""
POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:; "
    "connect-src 'self' http://127.0.0.1:* http://localhost:* data: blob:"
)
_PASSED_ON = ("Content-Type", "Content-Encoding")


def kept_here(page: bytes) -> bytes:
    """The page without what leads elsewhere."""
    return _ELSEWHERE.sub(b"", page).replace(_HEAD, _STAY_HERE, 1)


@contextmanager
def serve_page(upstream: int, *, host: str, port: int) -> Iterator[int]:
    """Serve the page of a web viewer until the block ends.

    Args:
        upstream: The port of this machine where Rerun serves it.
        host: Where to serve it.
        port: Where to serve it; 0 for any free one.

    Yields:
        The port.

    Raises:
        ViewerError: The port is in use, or is not ours to take.
    """

    class Handler(_Page):
        origin = f"http://127.0.0.1:{upstream}"

    try:
        server = ThreadingHTTPServer((host, port), Handler)
    except OSError as error:
        raise ViewerError(
            f"cannot serve the page at {host}:{port} ({error.strerror or error}), expected a free port: choose another "
            "with --port, or 0 for any"
        ) from error
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, name="page", daemon=True)
    thread.start()
    try:
        yield int(server.server_address[1])
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Page(BaseHTTPRequestHandler):
    """Answers with what Rerun's server answers."""

    origin: ClassVar[str]

    def do_GET(self) -> None:  # The name that http.server looks for.
        try:
            with urlopen(f"{self.origin}{self.path}", timeout=LIMIT_S) as answer:
                body, headers = answer.read(), answer.headers
        except HTTPError as error:
            self.send_error(error.code)
            return
        except (URLError, TimeoutError):
            self.send_error(502, "the viewer went away")
            return
        if headers.get_content_type() == "text/html":
            body = kept_here(body)
        self.send_response(200)
        for name in _PASSED_ON:
            if name in headers:
                self.send_header(name, headers[name])
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", POLICY)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *values: object) -> None:
        """Say nothing: the terminal belongs to the command."""
