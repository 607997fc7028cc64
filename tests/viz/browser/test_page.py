"""The page asks nobody but this machine."""

from __future__ import annotations

import re
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from handsight.viz.browser.page import POLICY, kept_here, serve_page
from handsight.viz.browser.viewer import web_viewer
from handsight.viz.errors import ViewerError

LIMIT_S = 30.0
PAGE = b"""<html><head>
<link rel="icon" href="favicon.ico" />
<link rel="preconnect" href="https://fonts.example" crossorigin />
<link
  href="https://fonts.example/css2?family=Inter&display=swap"
  rel="stylesheet"
/>
</head></html>"""


def get(port: int, path: str = "/") -> tuple[int, bytes, dict[str, str]]:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=LIMIT_S) as answer:
            return answer.status, answer.read(), dict(answer.headers)
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read(), dict(error.headers)


@pytest.fixture
def upstream() -> Iterator[int]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            files = {"/": ("text/html; charset=utf-8", PAGE), "/x.wasm": ("application/wasm", b"\0asm" * 9)}
            if self.path not in files:
                self.send_error(404)
                return
            kind, body = files[self.path]
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *values: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield server.server_address[1]
        server.shutdown()
        thread.join()


def test_what_leads_elsewhere_is_taken_out_and_the_rest_is_as_it_was() -> None:
    page = kept_here(PAGE)
    assert b"https://" not in page
    assert b'<link rel="icon" href="favicon.ico" />' in page
    assert page.index(b"window.fetch") < page.index(b"favicon")


def test_pages_and_files_pass_with_their_kind_and_a_policy(upstream: int) -> None:
    with serve_page(upstream, host="127.0.0.1", port=0) as port:
        status, body, headers = get(port)
        assert (status, body) == (200, kept_here(PAGE))
        assert headers["Content-Security-Policy"] == POLICY
        status, body, headers = get(port, "/x.wasm")
        assert (status, body, headers["Content-Type"]) == (200, b"\0asm" * 9, "application/wasm")
        assert get(port, "/none")[0] == 404
    with pytest.raises(urllib.error.URLError):
        get(port)


def test_a_port_in_use_is_refused(upstream: int) -> None:
    with (
        pytest.raises(ViewerError, match=r"expected a free port"),
        serve_page(upstream, host="127.0.0.1", port=upstream),
    ):
        pass


def test_a_viewer_that_went_away_is_said_to_have(upstream: int) -> None:
    with serve_page(1, host="127.0.0.1", port=0) as port:
        assert get(port)[0] == 502


def test_the_page_of_the_real_viewer_names_no_other_machine_to_load_from() -> None:
    """Its script for a hosted viewer is guarded by the host's name, and the policy would refuse it."""
    with web_viewer("rerun+http://127.0.0.1:1/entry/none") as viewer:
        port = int(re.findall(r":(\d+)/", viewer.page)[0])
        status, page, headers = get(port, "/")
        assert status == 200
        assert b"window.fetch" in page
        assert re.findall(rb"<(?:link|script|img)\b[^>]*https?://[^>]*>", page) == []
        assert headers["Content-Security-Policy"] == POLICY
        assert get(port, "/re_viewer_bg.wasm")[1][:4] == b"\0asm"
