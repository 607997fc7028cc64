"""A CSV table as lines that know where they stand."""

from __future__ import annotations

from pathlib import Path

import pytest

from handsight.datasets import InterchangeError
from handsight.datasets.exchange.table_lines import read_lines


def lines_of(path: Path, text: str | bytes) -> list[tuple[int, dict[str, str]]]:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return [(line.number, line.cells) for line in read_lines(path, required=("a", "b"), optional=("c",))]


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("a,b\n1,2\n3,4\n", [2, 3]),
        ("a,b\n\n1,2\n\n\n3,4", [3, 6]),
        ("a,b\r\n1,2\r\n\r\n3,4\r\n", [2, 4]),
        ('a,b\n"1\n\n",2\n3,4\n', [2, 5]),
        ("a,b\n1,2\n,\n3,4\n , \n", [2, 4]),
        ("\ufeffa,b\n1,2\n", [2]),
        ("\n\na,b\n1,2\n", [4]),
    ],
)
def test_lines_are_counted_as_an_editor_counts_them(tmp_path: Path, text: str, numbers: list[int]) -> None:
    assert [number for number, _ in lines_of(tmp_path / "t.csv", text)] == numbers


def test_cells_come_by_column_whatever_the_order(tmp_path: Path) -> None:
    assert lines_of(tmp_path / "t.csv", "b,c,a\n2,,1\n") == [(2, {"a": "1", "b": "2", "c": ""})]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b,a\n1,2,3\n", "columns stand more than once: 'a'; keep one of each"),
        ("a,b,A\n1,2,3\n", "columns are unknown: 'A' "),
        ("a;b\n1;2\n", "its separator is ';', expected a comma"),
        ("a\tb\n1\t2\n", r"its separator is '\\t', expected a comma"),
        ("a|b\n1|2\n", r"its separator is '\|', expected a comma"),
        ("a,x\n1,2\n", "columns are missing: b; columns are unknown: 'x'"),
        ("a,b\n1,2,3\n\n4\n", "line 2 has 3 cells, expected 2; line 4 has 1 cell, expected 2"),
        ("a,b\n", "there are no attempts"),
        ("", "columns are missing: a, b; there are no attempts"),
        ('a,b\n"1,2\n', "cannot be read as a table"),
        (b"a,b\n\xff,2\n", "is not UTF-8 "),
        ("a,b\n1,2\n".encode("utf-16"), "is not UTF-8 "),
        ("a,b\n" + "x" * 200_000 + ",2\n", "cannot be read as a table: field larger than"),
        ("a,b\n" + "1\n" * 15, "line 11 has 1 cell, expected 2; and 5 more faults"),
    ],
)
def test_what_is_no_such_table_is_said_at_once(tmp_path: Path, text: str | bytes, message: str) -> None:
    with pytest.raises(InterchangeError, match=message):
        lines_of(tmp_path / "t.csv", text)


def test_a_table_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(InterchangeError, match="cannot be read: No such file"):
        read_lines(tmp_path / "t.csv", required=("a",), optional=())
