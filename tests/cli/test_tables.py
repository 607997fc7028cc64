"""Tables in any width: whole words, one line a row, no line too long that could be shorter, and what was left out."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handsight.cli.tables import Column, cells_wide, print_facts, print_table, screen_width, short_snapshot, table_lines

COLUMNS = (
    Column(heading="attempt", short=lambda cell: cell[:8]),
    Column(heading="outcome", rank=1),
    Column(heading="x [m]", rank=3),
    Column(heading="failure", rank=2, prose="clip"),
)
WHOLE_ROW = ("01M8ASKA32CHGZZDFRGCA8YCM2-000000", "aborted", "-0.2500", "settle: objects still moved after 5 s")
NARROWEST = len("01M8ASKA")
WORDS = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=12)
PROSE = st.lists(WORDS, max_size=12).map(" ".join)


def test_with_room_everything_is_whole() -> None:
    head, row = table_lines(COLUMNS, [WHOLE_ROW], width=200)
    assert head.split() == ["attempt", "outcome", "x", "[m]", "failure"]
    assert row == "  ".join(WHOLE_ROW)


def test_ids_shrink_before_prose_and_prose_before_columns_go() -> None:
    narrow = {width: table_lines(COLUMNS, [WHOLE_ROW], width=width)[1] for width in (70, 56, 40, 20, 8)}
    assert narrow[70] == "01M8ASKA  aborted  -0.2500  settle: objects still moved after 5 s"
    assert narrow[56] == "01M8ASKA  aborted  -0.2500  settle: objects still…"
    assert narrow[40] == "01M8ASKA  aborted  settle: objects…"
    assert narrow[20] == "01M8ASKA  aborted"
    assert narrow[8] == "01M8ASKA"


def test_one_line_says_what_was_left_out_and_what_width_has_room() -> None:
    whole = " ".join(table_lines(COLUMNS, [WHOLE_ROW], width=40)[2:])
    assert whole == "left out to fit 40 columns: x [m]; 48 columns have room"
    assert len(table_lines(COLUMNS, [WHOLE_ROW], width=48)) == 2
    assert len(table_lines(COLUMNS, [WHOLE_ROW], width=47)) > 2


@given(
    rows=st.lists(st.tuples(WORDS, WORDS, PROSE, PROSE), max_size=6),
    width=st.integers(1, 200),
)
def test_no_word_is_split_and_no_row_is_two_unless_prose_is_wrapped(
    rows: list[tuple[str, str, str, str]], width: int
) -> None:
    columns = ("a", Column(heading="b", rank=2), Column(heading="c", rank=1, prose="clip"))
    cut = [row[:3] for row in rows]
    lines = table_lines(columns, cut, width=width)
    body = lines[1 : 1 + len(rows)]
    assert len(body) == len(rows)
    assert all(line == line.rstrip() for line in lines)
    wrapped = table_lines(("a", Column(heading="d", prose="wrap")), [(row[0], row[3]) for row in rows], width=width)
    shown = " ".join(wrapped[1:]).split()
    for row in rows:
        for word in row[3].split():
            assert word in shown


@given(
    cells=st.lists(st.tuples(st.sampled_from(["x", "yy"]), PROSE), min_size=1, max_size=5), width=st.integers(40, 120)
)
def test_a_line_is_longer_than_the_screen_only_for_a_word_that_is(cells: list[tuple[str, str]], width: int) -> None:
    lines = table_lines(("id", Column(heading="text", prose="wrap")), cells, width=width)
    assert max(map(cells_wide, lines)) <= width


def test_a_line_break_within_a_cell_breaks_no_table() -> None:
    assert table_lines(("a", "b"), [("one\ntwo", "x\ty")], width=80)[1:] == ["one two  x y"]


def test_names_that_cannot_fit_are_clipped_at_last() -> None:
    (_, row) = table_lines(("id", Column(heading="name")), [("7", "a" * 90)], width=40)
    assert row == f" 7  {'a' * 35}…"
    assert len(row) == 40


@pytest.mark.parametrize(("columns", "wide"), [("60", 60), ("200", 200), ("0", 80), ("-5", 80), ("x", 80), ("", 80)])
def test_the_width_is_that_of_columns_or_a_sane_one(columns: str, wide: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    with Path("/dev/null").open("w") as no_terminal:
        monkeypatch.setattr("sys.__stdout__", no_terminal)
        assert screen_width() == wide


def test_nothing_is_markup_and_nothing_is_padded(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(("name", "[bold]x[/]"), [("[red]lab[/red]", "y"), ("b", ":warning:")])
    print_facts([("[i]name[/i]", "[link=x]value[/link] " + "long " * 30), ("other", "")])
    out = capsys.readouterr().out
    assert "[red]lab[/red]" in out
    assert "[bold]x[/]" in out
    assert ":warning:" in out
    assert "[link=x]value[/link]" in out
    assert all(line == line.rstrip() for line in out.splitlines())
    assert "\x1b" not in out


def test_short_snapshots_differ() -> None:
    ids = ["AAAAAAAAAA0000000001", "AAAAAAAAAB0000000001", "C0000000000000000000"]
    short = short_snapshot(ids)
    assert [short(one) for one in ids] == ["AAAAAAAAAA", "AAAAAAAAAB", "C000000000"]
    assert short_snapshot(["C0000000000000000000"])("C0000000000000000000") == "C0000000"
