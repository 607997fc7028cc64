"""The dataset browser over many attempts: until the first card, a page of cards, and what it takes on disk."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from rerun.experimental import ViewerClient

from benchmarks import Figure, duration_s, median_s
from benchmarks.floors.frames import rendered_attempts
from benchmarks.floors.million import header_of, write_million
from handsight.datasets import GraspDataset, SessionWriter
from handsight.viz.browser.browser import Browser, BrowserSettings
from handsight.viz.browser.shelf import Wanted
from handsight.viz.recordings.screenshot import headless_viewer, patiently

WITHOUT_PICTURES = 29_600
WITH_PICTURES = 400
PAGE = 40
"""Cards that the viewer asks for at 1920x1080, those just below the edge included."""
LIMIT_S = 120.0
QUIET_S, POLL_S = 0.3, 0.02
MANY_COLOURS = 3_000
"""A screen with cards has more colours than one without: they are photographs."""
_SEED = 0


def browsing_figures(folder: Path) -> list[Figure]:
    """Figures of the browser over 30,000 attempts, of which those that are looked at have pictures."""
    path = folder / "grasps"
    _write(path)
    total = WITHOUT_PICTURES + WITH_PICTURES
    floor_s = duration_s(_bare_viewer)
    first_s = duration_s(lambda: _first_card(path, folder / "first"))
    with _browser(path, folder / "pages") as browser:
        pages = iter(range(WITH_PICTURES // PAGE))
        page_s = median_s(lambda: _make_page(browser, next(pages)), runs=5)
        bytes_per_card = browser.bytes_kept / browser.recordings_made
        opened_s = median_s(lambda: _open_next(browser, next(pages)), runs=3)
        bytes_opened = browser.bytes_kept
    return [
        Figure(
            name="first card",
            ours=first_s,
            unit="s",
            floor=floor_s,
            n=total,
            what="From opening a dataset of 30,000 attempts to a screen full of cards, viewer's start included; the "
            "floor is the viewer's start alone, until it draws.",
        ),
        Figure(
            name="page of cards",
            ours=page_s,
            unit="s",
            n=PAGE,
            what="Making and registering the recordings of 40 cards that nobody has looked at before.",
        ),
        Figure(
            name="attempt opened",
            ours=opened_s,
            unit="s",
            n=1,
            what="Making and registering the recording that a card opens, without a heatmap.",
        ),
        Figure(
            name="disk, if every card were looked at",
            ours=total * bytes_per_card / 1e6,
            unit="MB",
            peers={"limit unless another is given": 1000.0, "kept by this benchmark": bytes_opened / 1e6},
            n=total,
            what="Bytes of one card, times 30,000; what was not looked at the longest goes when the limit is reached.",
        ),
    ]


def _write(path: Path) -> None:
    repository = write_million(path, sessions=1, attempts=WITHOUT_PICTURES)
    header = header_of(_SEED + 1)
    writer = SessionWriter.begin(repository, header)
    for attempt in rendered_attempts(header, WITH_PICTURES, np.random.default_rng(_SEED)):
        writer.append(attempt)
    writer.seal()


@contextmanager
def _browser(path: Path, cards: Path) -> Iterator[Browser]:
    """The newest attempts first."""
    dataset = GraspDataset.open(str(path))
    ids = [str(key) for key in dataset.tail(WITHOUT_PICTURES + WITH_PICTURES, ("number",)).index][::-1]
    with Browser(dataset, ids, BrowserSettings(cards=cards), curator=None) as browser:
        yield browser


def _first_card(path: Path, cards: Path) -> None:
    with _browser(path, cards) as browser, headless_viewer() as viewer:
        patiently(lambda: viewer.open(browser.address), time.monotonic() + LIMIT_S, "open the cards")
        # A picture of the screen holds the viewer up: one is taken once it has what it asked for.
        _until_answered(browser)
        _until(viewer, MANY_COLOURS)


def _until_answered(browser: Browser) -> None:
    """Wait until the viewer has asked for cards, and for no more of them in a while."""
    deadline = time.monotonic() + LIMIT_S
    made, since = 0, time.monotonic()
    while time.monotonic() < deadline and (not made or time.monotonic() - since < QUIET_S):
        if browser.recordings_made != made:
            made, since = browser.recordings_made, time.monotonic()
        time.sleep(POLL_S)


def _bare_viewer() -> None:
    with headless_viewer() as viewer:
        _until(viewer, 1)


def _until(viewer: ViewerClient, colours: int) -> None:
    """Wait until the viewer draws so many colours."""
    deadline = time.monotonic() + LIMIT_S
    while time.monotonic() < deadline:
        png = patiently(viewer.take_screenshot, deadline, "draw")
        picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
        if picture is not None and len(np.unique(picture.reshape(-1, 3), axis=0)) >= colours:
            return
    raise TimeoutError(f"the viewer drew fewer than {colours} colours within {LIMIT_S:.0f} s")


def _make_page(browser: Browser, page: int) -> None:
    browser.provide([Wanted("card", key) for key in browser.ids[page * PAGE : (page + 1) * PAGE]])


def _open_next(browser: Browser, page: int) -> None:
    browser.provide([Wanted("attempt", browser.ids[page * PAGE])])
