"""Listing attempts: what is chosen, in what order, in which columns, and that no more is read than has to be."""

from __future__ import annotations

import pandas as pd
import pytest
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import Curator, GraspDataset, GraspRepository, ListingError, Selection, WhereError
from handsight.datasets.curation.saved_filters import save_filter
from handsight.datasets.reading.listing import Listed, Listing, list_attempts


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    """Two sessions of 25 and 15 attempts, a saved filter and some exclusions."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("listing") / "grasps")
    for seed, size in ((1, 25), (2, 15)):
        header = make_header(seed=seed)
        record(repository, header, [make_attempt(header, number) for number in range(size)], every=25)
    Curator(repository, author="jo").exclude(Selection(where="number == 3"), "dark")
    save_filter(repository, "cups", "target == 'cup'", author="jo")
    return GraspDataset(repository, ref="main")


def ids(listed: Listed) -> list[str]:
    return [str(key) for key in listed.rows.index]


def test_without_wishes_it_is_the_table(dataset: GraspDataset) -> None:
    found = list_attempts(dataset, Listing())
    pd.testing.assert_frame_equal(found.rows, dataset.attempts)
    assert (found.matched, found.total) == (40, 40)


@pytest.mark.parametrize("where", ["", "number >= 0"])
def test_a_limit_takes_the_newest(dataset: GraspDataset, where: str) -> None:
    newest = dataset.attempts.tail(7)
    pd.testing.assert_frame_equal(list_attempts(dataset, Listing(where=where, limit=7)).rows, newest)
    turned = list_attempts(dataset, Listing(where=where, limit=7, reverse=True))
    pd.testing.assert_frame_equal(turned.rows, newest[::-1])
    assert turned.matched == 40


def test_filter_and_expression_must_both_hold(dataset: GraspDataset) -> None:
    table = dataset.attempts
    cups = table[table["target"] == "cup"]
    found = list_attempts(dataset, Listing(filter="cups"))
    pd.testing.assert_frame_equal(found.rows, cups)
    both = list_attempts(dataset, Listing(filter="cups", where="objects.str.contains('duck') or excluded", limit=1))
    expected = cups[cups["objects"].map(lambda names: "duck" in names) | cups["excluded"]]
    assert ids(both) == expected.index[-1:].tolist()
    assert len(cups) > both.matched == len(expected) > 1
    nothing = list_attempts(dataset, Listing(where="number > 1000"))
    assert (len(nothing.rows), nothing.matched, nothing.total) == (0, 0, 40)
    assert nothing.rows.columns.tolist() == table.columns.tolist()


@pytest.mark.parametrize("sort", ["width_final_m", "target", "success", "started", "objects", "attempt", "excluded"])
def test_an_order_is_stable_and_shows_the_first(dataset: GraspDataset, sort: str) -> None:
    table = dataset.attempts.reset_index().set_index("attempt", drop=False)
    known, missing = table[table[sort].notna()], table[table[sort].isna()]
    for reverse in (False, True):
        rows = sorted(known.index, key=lambda key: known.loc[key, sort], reverse=reverse)
        found = list_attempts(dataset, Listing(sort=sort, reverse=reverse))
        assert ids(found) == [*rows, *missing.index]
        assert ids(list_attempts(dataset, Listing(sort=sort, reverse=reverse, limit=5))) == ids(found)[:5]


def test_columns_come_in_the_order_asked_for(dataset: GraspDataset) -> None:
    names = ("excluded", "number", "attempt", "table_friction", "number")
    expected = dataset.attempts[["excluded", "number", "table_friction"]]
    for where in ("", "success"):
        found = list_attempts(dataset, Listing(where=where, columns=names))
        pd.testing.assert_frame_equal(found.rows, expected.loc[found.rows.index])
    assert list_attempts(dataset, Listing(columns=(), limit=3)).rows.shape == (3, 0)


def test_only_what_is_needed_is_read(dataset: GraspDataset, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[tuple[str, int]] = []
    plain = GraspDataset._column

    def watched(self: GraspDataset, ulid: str, name: str, start: int = 0, stop: int | None = None) -> object:
        values = plain(self, ulid, name, start, stop)
        read.append((name, len(values)))
        return values

    monkeypatch.setattr(GraspDataset, "_column", watched)
    list_attempts(dataset, Listing(limit=4))
    assert {rows for _, rows in read} == {4}
    read.clear()
    listing = Listing(where="width_final_m > 0.05", sort="contact_force_n", columns=("target",), limit=1)
    assert list_attempts(dataset, listing).matched > 1
    whole = {name for name, rows in read if rows > 1}
    assert whole == {"number", "outcome", "gripper_width_m", "contact_force_n"}
    assert {name for name, rows in read if rows == 1} >= {"target", "catalogue_index"}


def test_every_fault_is_told_at_once(dataset: GraspDataset) -> None:
    listing = Listing(
        where="sucess", filter="cupz", sort="widht_final_m", columns=("numbr", "qqqq", "zzzz", "target"), limit=-3
    )
    with pytest.raises(ListingError) as caught:
        list_attempts(dataset, listing)
    text = str(caught.value)
    for said in (
        "limit is -3, expected 0",
        "no column 'widht_final_m', did you mean width_final_m",
        "no column 'numbr', did you mean number",
        "no column 'qqqq' or 'zzzz', expected one of attempt, session",
        "no saved filter 'cupz', did you mean cups",
        "no column 'sucess', did you mean success",
    ):
        assert said in text
    assert text.count("expected one of attempt") == 1


@pytest.mark.parametrize("where", ["number", "target", "True"])
def test_what_is_no_truth_value_is_refused(dataset: GraspDataset, where: str) -> None:
    with pytest.raises(WhereError, match="expected true or false"):
        list_attempts(dataset, Listing(where=where))
