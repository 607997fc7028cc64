"""The browser end to end: Rerun's catalog and viewer, without a window."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pyarrow as pa
import pytest
from rerun.catalog import CatalogClient
from tests.support.rrd import colours, read_picture

from handsight.datasets import GraspDataset
from handsight.datasets.curation.curator import Curator
from handsight.datasets.reading.selection import Selection
from handsight.viz.browser.browser import Browser, BrowserSettings
from handsight.viz.browser.catalog import TABLE
from handsight.viz.errors import BrowserError, NoVulkanError
from handsight.viz.recordings.screenshot import save_address_picture


def browse(dataset: GraspDataset, tmp_path: Path, *, decides: bool = True, port: int = 0) -> Browser:
    ids = [str(key) for key in dataset.attempts.index]
    curator = Curator(dataset.repository, author="me") if decides else None
    return Browser(dataset, ids, BrowserSettings(cards=tmp_path / "cards", port=port), curator=curator)


def edit(browser: Browser, attempt: str, **cells: object) -> None:
    """Edit cells as the viewer does: the row is written again through the catalog's own door."""
    table = CatalogClient(f"rerun+http://127.0.0.1:{browser.port}").get_table(TABLE)
    (row,) = [row for row in table.reader().to_arrow_table().to_pylist() if row["attempt"] == attempt]
    schema = table.arrow_schema()
    table.upsert(pa.RecordBatch.from_pylist([{**row, **cells}], schema=schema))


def row_of(browser: Browser, attempt: str) -> dict[str, object]:
    table = CatalogClient(f"rerun+http://127.0.0.1:{browser.port}").get_table(TABLE)
    (row,) = [row for row in table.reader().to_arrow_table().to_pylist() if row["attempt"] == attempt]
    return dict(row)


def test_cards_and_an_attempt_are_drawn_and_only_what_is_looked_at_is_made(
    dataset: GraspDataset, tmp_path: Path
) -> None:
    with browse(dataset, tmp_path) as browser:
        assert browser.recordings_made == 0
        try:
            save_address_picture(browser.address, tmp_path / "cards.png")
        except NoVulkanError as error:
            pytest.skip(str(error))
        assert browser.recordings_made == len(dataset.attempts)
        kept = browser.bytes_kept
        assert kept == sum(path.stat().st_size for path in (tmp_path / "cards").rglob("*.rrd"))
        save_address_picture(browser.attempt_address(str(dataset.attempts.index[0])), tmp_path / "attempt.png")
        assert browser.recordings_made == len(dataset.attempts) + 1
        assert browser.bytes_kept > kept
        assert browser.failures() == []
    cards, attempt = read_picture(tmp_path / "cards.png"), read_picture(tmp_path / "attempt.png")
    height, width = cards.shape[:2]
    # Four cards in a row, each with its picture.
    for column in range(4):
        left = int((0.16 + 0.21 * column) * width)
        assert colours(cards[int(0.2 * height) : int(0.37 * height), left : left + int(0.13 * width)]) > 500
    assert colours(attempt[: int(0.55 * height), : int(0.3 * width)]) > 2000
    assert colours(attempt[int(0.65 * height) :, int(0.45 * width) : int(0.66 * width)]) > 20


def test_an_edit_in_the_viewer_is_a_decision_that_can_be_undone(dataset: GraspDataset, tmp_path: Path) -> None:
    attempt = str(dataset.attempts.index[dataset.attempts["success"].notna()][0])
    with browse(dataset, tmp_path) as browser:
        assert browser.decide_edits() == []
        edit(browser, attempt, excluded=True)
        (decided,) = browser.decide_edits()
        assert decided.decision is not None
        assert (decided.edit.attempt, decided.edit.act) == (attempt, "exclude")
        assert browser.decide_edits() == []
        assert bool(GraspDataset.open(str(dataset.repository.path)).attempts["excluded"][attempt])
        assert row_of(browser, attempt)["curation"] == "excluded: excluded in the browser"

        Curator(dataset.repository, author="somebody").undo()
        assert browser.follow() == [attempt]
        assert browser.follow() == []
        assert row_of(browser, attempt)["excluded"] is False
        assert browser.decide_edits() == []


def test_what_cannot_be_decided_is_put_back(dataset: GraspDataset, tmp_path: Path) -> None:
    attempt = str(dataset.attempts.index[dataset.attempts["success"].notna()][0])
    with browse(dataset, tmp_path) as browser:
        before = row_of(browser, attempt)
        edit(browser, attempt, label="perhaps")
        assert browser.decide_edits() == []
        assert row_of(browser, attempt) == before


def test_a_viewer_whose_row_is_old_does_not_take_back_a_label(dataset: GraspDataset, tmp_path: Path) -> None:
    """It writes the whole row again: the label it still has is not one that anybody wants."""
    attempt = str(dataset.attempts.index[dataset.attempts["success"].notna()][0])
    success = bool(dataset.attempts["success"][attempt])
    with browse(dataset, tmp_path) as browser:
        old = row_of(browser, attempt)
        Curator(dataset.repository, author="somebody").relabel(Selection(ids=(attempt,)), not success, "seen")
        browser.follow()
        edit(browser, attempt, excluded=True, label=old["label"])
        (decided,) = browser.decide_edits()
        assert decided.edit.act == "exclude"
        again = GraspDataset.open(str(dataset.repository.path)).attempts
        assert bool(again["success"][attempt]) is not success
        assert row_of(browser, attempt)["label"] != old["label"]


def test_nothing_is_decided_about_a_release(dataset: GraspDataset, tmp_path: Path) -> None:
    attempt = str(dataset.attempts.index[0])
    with browse(dataset, tmp_path, decides=False) as browser:
        edit(browser, attempt, excluded=True)
        (decided,) = browser.decide_edits()
        assert (decided.decision, decided.refused) == (None, "a release does not change")
        assert browser.follow() == []
    assert GraspDataset.open(str(dataset.repository.path)).snapshot_id == dataset.snapshot_id


def test_nothing_is_left_where_temporary_files_go(
    dataset: GraspDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", None)
    with browse(dataset, tmp_path) as browser:
        assert list(temporary.iterdir())
        try:
            save_address_picture(browser.address, tmp_path / "cards.png")
        except NoVulkanError as error:
            pytest.skip(str(error))
    assert list(temporary.iterdir()) == []


def test_a_port_in_use_is_refused_in_one_line_and_leaves_nothing(dataset: GraspDataset, tmp_path: Path) -> None:
    with (
        browse(dataset, tmp_path) as browser,
        pytest.raises(BrowserError, match=rf"cannot listen at 127\.0\.0\.1:{browser.port}"),
    ):
        browse(dataset, tmp_path, port=browser.port)
