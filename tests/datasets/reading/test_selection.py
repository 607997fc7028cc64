"""Expressions over the attempts table: what they select, and what they cannot reach."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.factories import make_attempt, make_header, record
from tests.support.typed_values import where_text

from handsight.datasets import AttemptNotFoundError, GraspDataset, GraspRepository, WhereError
from handsight.datasets.reading.selection import Selection, matches, select


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    repository = GraspRepository.create(tmp_path_factory.mktemp("selection") / "grasps")
    header = make_header()
    record(repository, header, [make_attempt(header, number) for number in range(40)], every=40)
    return GraspDataset.open(str(repository.path)).attempts


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ("success", lambda row: row["success"] is True),
        ("not success", lambda row: row["success"] is False),
        ("success == False and width_final_m < 0.001", lambda row: row["width_final_m"] < 0.001),
        ("target == 'cup' or target == 'egg'", lambda row: row["target"] in ("cup", "egg")),
        ("target in ['cup', 'egg'] and ~excluded", lambda row: row["target"] in ("cup", "egg")),
        ("target.isna()", lambda row: row["target"] is None),
        ("objects.str.contains('duck')", lambda row: "duck" in row["objects"]),
        ("failure.str.startswith('look')", lambda row: row["failure"].startswith("look")),
        ("3 <= number < 7", lambda row: 3 <= row["number"] < 7),
        ("abs(pregrasp_x_m) > 1 & overhead_taken", lambda row: abs(row["pregrasp_x_m"]) > 1),
        ("number % 2 == 1", lambda row: row["number"] % 2 == 1),
        ("started > '2023-11-20'", lambda row: row["started"] > pd.Timestamp("2023-11-20", tz="UTC")),
        ("seed == 2", lambda row: False),
    ],
)
def test_an_expression_selects_what_it_says(table: pd.DataFrame, where: str, expected: object) -> None:
    assert callable(expected)
    plain = table.astype(object).where(table.notna(), None)
    rows = [str(identity) for identity, row in plain.iterrows() if expected(_without_none(row))]
    assert select(table, Selection(where=where), {}) == rows


def _without_none(row: pd.Series[Any]) -> dict[str, object]:
    """Missing numbers as NaN, which compares as false."""
    return {
        str(name): float("nan") if value is None and str(name).endswith(("_m", "_s")) else value
        for name, value in row.items()
    }


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("widht_final_m < 1", "no column 'widht_final_m', did you mean width_final_m"),
        ("foo == 1 and taget == 'cup'", r"no column 'foo'.*; there is no column 'taget', did you mean target"),
        ("number", "yields int64, expected true or false"),
        ("True", "yields bool, expected true or false"),
        ("number > 'a'", "number holds numbers and 'a' is text, expected number > 0.01"),
        ("target.str.contains('(')", "no pattern that can be looked for"),
        ("number > 1 / 0", "cannot be evaluated: division by zero"),
        ("number ==", "is no expression: invalid syntax"),
        ("", "is no expression"),
        ("@pd", "is no expression"),
        ("number == @pd", "is no expression"),
        ("(" * 300 + "number" + ")" * 300, "is no expression"),
        ("x" * 5000, "has 5000 characters, expected at most 4096"),
        ("number = 3", "is no expression"),
        ("(number := 3) == 3", "is refused"),
        ("'a' * 1000000000 == target", "text cannot be calculated with"),
        ("9 ** 9 ** 9 == number", "Pow is not allowed"),
        ("target.to_csv('stolen')", ".to_csv is unknown, expected one of between"),
        ("number.__class__ == 1", ".__class__ is unknown"),
        ("__import__('os').system('true')", r"__import__\(\) is no known function"),
        ("target.str.contains.__globals__ == 1", ".__globals__ is unknown"),
        ("abs", "no column 'abs'"),
        ("abs.isna()", "no column 'abs'"),
        ("eval('1') == 1", r"eval\(\) is no known function"),
        ("[n for n in number] == 1", "is not allowed"),
        ("(lambda: number)() == 1", "cannot be called"),
        ("f'{number}' == 'a'", "is not allowed"),
        ("number[0] == 1", "is not allowed"),
    ],
)
def test_what_is_not_sound_is_refused(table: pd.DataFrame, where: str, message: str) -> None:
    with pytest.raises(WhereError, match=message):
        matches(table, where)


def test_nothing_is_written_by_an_expression(
    table: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for where in ("target.to_csv('stolen')", "target.to_csv('stolen') == 1", "open('stolen', 'w') == 1"):
        with pytest.raises(WhereError):
            matches(table, where)
    assert list(tmp_path.iterdir()) == []


@settings(max_examples=300)
@given(where=st.text(alphabet="number successabs.str()[]{}<>=!&|~'\"0123456789 @:,lambda*_", max_size=40))
def test_any_text_either_selects_or_is_refused(table: pd.DataFrame, where: str) -> None:
    try:
        found = matches(table, where)
    except WhereError:
        return
    assert found.dtype == bool
    assert found.index.equals(table.index)


@pytest.mark.parametrize("seed", range(2))
def test_whatever_is_typed_either_selects_or_is_refused(table: pd.DataFrame, seed: int) -> None:
    rng = np.random.default_rng(seed)
    found, said = 0, []
    for _ in range(200):
        where = where_text(rng)
        try:
            found += len(matches(table, where))
        except WhereError as error:
            said.append(str(error))
    assert found > 0
    assert [one for one in said if len(one.splitlines()) != 1] == []


def test_ids_come_back_once_in_the_order_of_the_table(table: pd.DataFrame) -> None:
    ids = table.index[[7, 3, 7]].tolist()
    assert select(table, Selection(ids=tuple(ids)), {}) == [ids[1], ids[0]]


def test_unknown_ids_are_all_named(table: pd.DataFrame) -> None:
    unknown = tuple(f"nowhere-{number:06d}" for number in range(7))
    with pytest.raises(AttemptNotFoundError, match=r"nowhere-000000.*nowhere-000004 and 2 more"):
        select(table, Selection(ids=(table.index[0], *unknown)), {})


def test_a_filter_and_an_expression_must_both_hold(table: pd.DataFrame) -> None:
    filters = {"cups": "target == 'cup'"}
    both = select(table, Selection(filter="cups", where="success"), filters)
    held = table["success"].fillna(False)
    assert both == [one for one in select(table, Selection(filter="cups"), filters) if held[one]]
    assert len(both) > 0
    with pytest.raises(WhereError, match=r"no saved filter 'cupz', did you mean cups\? \(filters: cups\)"):
        select(table, Selection(filter="cupz"), filters)


@pytest.mark.parametrize("which", [{}, {"ids": ("a",), "where": "success"}, {"ids": ("a",), "filter": "v"}])
def test_a_selection_is_either_ids_or_an_expression(which: dict[str, object]) -> None:
    with pytest.raises(WhereError, match="expected either ids or an expression"):
        Selection(**which)  # type: ignore[arg-type]  # The faults are the point.
