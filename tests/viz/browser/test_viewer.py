"""The page of ``--web`` in a real browser, which draws it without a graphics card."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tests.support.devtools import SOFTWARE, watched_page
from tests.support.rrd import read_picture

from handsight.datasets import GraspDataset
from handsight.viz import palette
from handsight.viz.browser.browser import Browser, BrowserSettings
from handsight.viz.browser.viewer import web_viewer

NEAR = 12
"""So far a colour may be from another, in each of its parts, to be the same on a screen."""
LEAST_PX = 60
"""Of the jaws of two cards, thumbnails of 400 pixels."""


def pixels_of(picture: Path, colour: palette.Rgb) -> int:
    """How many pixels have a colour."""
    apart = np.abs(read_picture(picture)[..., :3].astype(int) - np.array(colour))
    return int((apart.max(axis=-1) < NEAR).sum())


def test_whoever_watches_a_page_hears_its_errors_and_whom_it_asks(tmp_path: Path) -> None:
    """Or the tests below could not fail."""
    loud = tmp_path / "loud.html"
    loud.write_text(
        "<!doctype html><title>loud</title><script>console.error('said', 1); console.warn('no error');"
        "fetch('http://elsewhere.example/x').catch(() => { throw Error('thrown'); });</script>"
    )
    with watched_page(loud.as_uri(), tmp_path) as page:
        page.wait_until(lambda: any("thrown" in said for said in page.said), "throwing")
    assert page.said[0] == "said 1"
    assert "no error" not in " ".join(page.said)
    assert page.elsewhere() == ["http://elsewhere.example/x"]


def test_the_page_draws_cards_without_an_error_and_asks_nobody_else(dataset: GraspDataset, tmp_path: Path) -> None:
    ids = [str(key) for key in dataset.attempts.index]
    settings = BrowserSettings(cards=tmp_path / "cards")
    (tmp_path / "browser").mkdir()
    with (
        Browser(dataset, ids, settings, curator=None) as browser,
        web_viewer(browser.address) as viewer,
        watched_page(viewer.page, tmp_path / "browser", "--window-size=1000,700", *SOFTWARE) as page,
    ):
        page.wait_until(lambda: browser.recordings_made > 0, "asking for cards")

        def drawn() -> bool:
            shot = page.screenshot(tmp_path / "page.png")
            return min(pixels_of(shot, palette.HELD), pixels_of(shot, palette.EMPTY)) > LEAST_PX

        page.wait_until(drawn, "drawing cards")
        assert browser.failures() == []
    assert page.said == []
    assert page.elsewhere() == []
    assert f"http://127.0.0.1:{browser.port}/" in {url[: url.index("/", 8) + 1] for url in page.requests}
