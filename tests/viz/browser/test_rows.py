"""The browser's table says what the dataset says."""

from __future__ import annotations

import math
from typing import Any

import pytest

from handsight.datasets import GraspDataset
from handsight.datasets.curation.curator import Curator
from handsight.datasets.reading.selection import Selection
from handsight.viz.browser.rows import SCHEMA, Seen, browser_rows, table_batch


@pytest.fixture
def ids(dataset: GraspDataset) -> list[str]:
    return [str(key) for key in dataset.attempts.index][::-1]


def addresses(ids: list[str], kind: str) -> dict[str, str]:
    return {key: f"{kind}/{key}" for key in ids}


def test_every_cell_is_what_was_recorded(dataset: GraspDataset, ids: list[str]) -> None:
    seen = Seen(predicted={ids[0]: 0.123456}, label_quality={ids[1]: 0.5}, findings={ids[2]: ("GD-201", "GD-202")})
    batch = table_batch(browser_rows(dataset, ids), seen, card=addresses(ids, "card"), opened=addresses(ids, "open"))
    assert batch.schema.equals(SCHEMA, check_metadata=True)
    rows = batch.to_pylist()
    assert [row["attempt"] for row in rows] == ids
    for row, key in zip(rows, ids, strict=True):
        recorded: Any = dataset.attempts.loc[key]
        assert row["outcome"] == recorded["outcome"]
        assert row["target"] == recorded["target"]
        assert row["excluded"] is False
        assert row["label"] == {True: "success", False: "failure"}.get(recorded["success"], "-")
        assert row["opening_mm"] is None or math.isclose(
            row["opening_mm"], 1e3 * recorded["width_final_m"], abs_tol=0.051
        )
        assert (row["card"], row["open"]) == (f"card/{key}", f"open/{key}")
        assert str(recorded["number"]) in row["title"]
    assert [rows[at]["predicted_success"] for at in (0, 1)] == [0.123, None]
    assert [rows[at]["label_quality"] for at in (0, 1)] == [None, 0.5]
    assert [rows[at]["findings"] for at in (1, 2)] == [None, "GD-201 GD-202"]


def test_curation_is_said(dataset: GraspDataset, ids: list[str]) -> None:
    labelled = dataset.attempts.index[dataset.attempts["success"].notna()]
    success = bool(dataset.attempts["success"][labelled[0]])
    curator = Curator(dataset.repository, author="me")
    curator.exclude(Selection(ids=(labelled[0],)), "blurred")
    curator.relabel(Selection(ids=(labelled[0],)), not success, "seen")
    again = GraspDataset.open(str(dataset.repository.path))
    batch = table_batch(browser_rows(again, ids), Seen(), card=addresses(ids, "card"), opened=addresses(ids, "open"))
    (row,) = (row for row in batch.to_pylist() if row["attempt"] == labelled[0])
    assert row["excluded"] is True
    assert row["label"] == ("failure" if success else "success")
    assert row["curation"] == f"excluded: blurred; relabelled from {'success' if success else 'failure'}"
