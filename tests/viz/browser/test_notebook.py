"""Cards in a cell of a notebook: a frame that shows them, decisions, and nothing left when it is closed."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import pyarrow as pa
import pytest
from rerun.catalog import CatalogClient
from tests.support.devtools import SOFTWARE, watched_page
from tests.support.html_page import HtmlPage

from handsight.datasets import GraspDataset
from handsight.datasets.curation.curator import Curator
from handsight.viz.browser.browser import Browser, BrowserSettings
from handsight.viz.browser.catalog import TABLE
from handsight.viz.browser.notebook import NotebookBrowser, cell_lines
from handsight.viz.errors import ViewerError

LIMIT_S = 30.0


def browse(dataset: GraspDataset, folder: Path) -> Browser:
    ids = [str(key) for key in dataset.attempts.index]
    return Browser(
        dataset, ids, BrowserSettings(cards=folder / "cards"), curator=Curator(dataset.repository, author="me")
    )


@contextmanager
def notebook_page(cell: str) -> Iterator[str]:
    """A page as a notebook's server would give it, from a port of its own, with what a cell shows."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            body = f'<!doctype html><html lang="en"><title>notebook</title><body>{cell}</body></html>'.encode()
            self.send_response(200 if self.path == "/" else 204)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(body) if self.path == "/" else 0))
            self.end_headers()
            if self.path == "/":
                self.wfile.write(body)

        def log_message(self, format: str, *values: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}/"
        server.shutdown()
        thread.join()


def test_a_cell_asks_for_cards_and_for_nothing_elsewhere(dataset: GraspDataset, tmp_path: Path) -> None:
    (tmp_path / "browser").mkdir()
    browser = browse(dataset, tmp_path)
    cards = NotebookBrowser(browser)
    with (
        notebook_page(cards._repr_html_()) as url,
        watched_page(url, tmp_path / "browser", "--window-size=1000,800", *SOFTWARE) as page,
    ):
        page.wait_until(lambda: browser.recordings_made > 0, "asking for cards")
    cards.close()
    assert page.said == []
    assert page.elsewhere() == []


def test_what_is_clicked_is_decided_and_closing_ends_page_and_browser(dataset: GraspDataset, tmp_path: Path) -> None:
    browser = browse(dataset, tmp_path)
    cards = NotebookBrowser(browser)
    with urlopen(cards.page, timeout=LIMIT_S) as answer:
        assert b"<html" in answer.read()
    assert cards.decide() == []
    attempt = browser.ids[0]
    table = CatalogClient(f"rerun+http://127.0.0.1:{browser.port}").get_table(TABLE)
    (row,) = [row for row in table.reader().to_arrow_table().to_pylist() if row["attempt"] == attempt]
    table.upsert(pa.RecordBatch.from_pylist([{**row, "excluded": True}], schema=table.arrow_schema()))
    (decided,) = cards.decide()
    assert (decided.edit.attempt, decided.edit.act) == (attempt, "exclude")
    assert bool(browser.dataset.attempts.loc[attempt, "excluded"])
    cards.close()
    cards.close()
    with pytest.raises(URLError):
        urlopen(cards.page, timeout=LIMIT_S)


def test_a_port_in_use_closes_the_browser(dataset: GraspDataset, tmp_path: Path) -> None:
    with browse(dataset, tmp_path) as other:
        browser = browse(dataset, tmp_path)
        with pytest.raises(ViewerError, match="expected a free port"):
            NotebookBrowser(browser, port=other.port)
        with pytest.raises(URLError):
            urlopen(f"http://127.0.0.1:{browser.port}/", timeout=LIMIT_S)


def test_the_lines_for_a_cell_are_python_whatever_the_address() -> None:
    page = "http://127.0.0.1:9/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A8%2Fentry%2F1&x=\"'<"
    lines = cell_lines(page)
    compile(lines, "cell", "exec")
    assert repr(page) in lines


def test_a_frame_has_a_title_and_its_page(dataset: GraspDataset, tmp_path: Path) -> None:
    cards = NotebookBrowser(browse(dataset, tmp_path))
    found = HtmlPage(cards._repr_html_())
    cards.close()
    assert found.misnested == []
    (frame,) = found.all("iframe")
    assert (frame["src"], frame["title"]) == (cards.page, "attempts as cards")
