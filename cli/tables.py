"""Tables and lists of facts that fit the screen: nothing is broken inside a word, and one row is one line.

A table that is too wide is made narrower in this order: cells that have a shorter form take it, such as ids and times;
prose gives way; columns are left out, the least important first, which the line below the table says. What still does
not fit is left to the terminal.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

from handsight.cli.output import bold, console
from handsight.datasets.errors import counted
from handsight.datasets.format.beginnings import telling_length

GAP = 2
"""Spaces between two columns."""
NARROWEST_PROSE = 20
"""Columns that prose is given at least, before another column is left out for it."""
LONGEST_WORD = 34
"""Longer words, such as paths and digests, are left to the terminal; whole ids are not."""
NARROWEST_NAME = 8
"""Columns that are left of a clipped name at least, once nothing else can give way."""
_NUMBER = re.compile(r"[-+0-9.,/% ]*")
"""A cell that is aligned right, if all of its column are; a time with its colons is not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """How one column of a table behaves where room is short."""

    heading: str
    rank: int = 0
    """Importance: the columns of the highest rank are left out first, those of rank 0 never."""
    prose: Literal["", "wrap", "clip"] = ""
    """Running text: broken between words into several lines, or cut at the end of one."""
    short: Callable[[str], str] | None = None
    """A cell in fewer characters that say the same, such as the beginning of an id."""


@dataclass(slots=True)
class _Strip:
    """One column with its cells, on its way to the screen."""

    column: Column
    cells: list[str]
    numeric: bool = field(init=False)
    width: int = field(init=False)

    def __post_init__(self) -> None:
        self.numeric = any(self.cells) and all(_NUMBER.fullmatch(cell) for cell in self.cells)
        self.fit()

    def fit(self) -> None:
        """Take the width of the widest cell."""
        self.width = max(map(cells_wide, (self.column.heading, *self.cells)))

    @property
    def least(self) -> int:
        """The width that it can go down to without being left out."""
        if not self.column.prose:
            return self.width
        words = " ".join(self.cells).split() if self.column.prose == "wrap" else ()
        longest = max(map(cells_wide, words), default=0)
        return min(self.width, max(NARROWEST_PROSE, min(longest, LONGEST_WORD), cells_wide(self.column.heading)))


def screen_width() -> int:
    """Columns that a table may fill: $COLUMNS, or else those of the terminal, or else 80."""
    return shutil.get_terminal_size().columns


def written(iso: str) -> str:
    """A time in UTC as ISO 8601 has it, for a column whose heading says that it is UTC."""
    return iso.replace("T", " ", 1).removesuffix("+00:00")


def short_time(written: str) -> str:
    """A time to the minute."""
    return written[: len("2026-01-31 12:00")]


def short_snapshot(ids: Iterable[str]) -> Callable[[str], str]:
    """What writes the ids of snapshots shortly, such that every command still takes them."""
    length = telling_length(ids)
    return lambda snapshot_id: snapshot_id[:length]


def cells_wide(text: str) -> int:
    """How many columns of a screen a text takes; an ideograph takes two."""
    from rich.cells import cell_len  # with the first table that is printed

    return cell_len(text)


def print_table(columns: Sequence[str | Column], rows: Sequence[Sequence[str]]) -> None:
    """A table in the width of the screen, and a line that names the columns left out, if any."""
    head, *lines = table_lines(columns, rows, width=screen_width())
    console.print(bold(head), *(f"\n{line}" for line in lines))


def print_facts(facts: Iterable[tuple[str, str]], *, indent: int = 0) -> None:
    """Names and what belongs to them, one below the other; long values go on below their beginning."""
    pairs = [(name, " ".join(value.split())) for name, value in facts]
    width = max((cells_wide(name) for name, _ in pairs), default=0)
    room = screen_width() - indent - width - GAP
    for name, value in pairs:
        first, *rest = _wrapped(value, max(room, NARROWEST_PROSE))
        console.print(" " * indent, bold(_padded(name, width + GAP) if first else name), first)
        for line in rest:
            console.print(" " * (indent + width + GAP), line)


def print_prose(text: str) -> None:
    """A sentence below a table, broken between words."""
    for line in _wrapped(text, screen_width()):
        console.print(line)


def table_lines(columns: Sequence[str | Column], rows: Sequence[Sequence[str]], *, width: int) -> list[str]:
    """The lines of a table: the heading, the rows, and what was left out."""
    whole = [one if isinstance(one, Column) else Column(heading=one) for one in columns]
    # A line break within a cell would break the table.
    strips = [_Strip(column, [" ".join(row[at].split()) for row in rows]) for at, column in enumerate(whole)]
    if _total(strips) > width:
        _shorten(strips)
    needed = _least_total(strips)
    left_out = _leave_out(strips, width)
    _squeeze(strips, width)
    lines = [_line([strip.column.heading for strip in strips], strips)]
    for number in range(len(rows)):
        lines += _row_lines([strip.cells[number] for strip in strips], strips)
    if left_out:
        names = ", ".join(column.heading for column in whole if column in left_out)
        lines += _wrapped(
            f"left out to fit {counted(width, 'column')}: {names}; {counted(needed, 'column')} have room", width
        )
    return lines


def _leave_out(strips: list[_Strip], width: int) -> list[Column]:
    """Take away the columns that had to go, the least important first, and return them."""
    left_out = []
    while _least_total(strips) > width:
        worst = max(range(len(strips)), key=lambda at: (strips[at].column.rank, at))
        if not strips[worst].column.rank:
            break
        left_out.append(strips.pop(worst).column)
    return left_out


def _shorten(strips: Iterable[_Strip]) -> None:
    for strip in strips:
        if strip.column.short is not None:
            strip.cells = [strip.column.short(cell) for cell in strip.cells]
            strip.fit()


def _squeeze(strips: Sequence[_Strip], width: int) -> None:
    """Take what is too much from prose, and then from names."""
    prose = [strip for strip in strips if strip.column.prose]
    names = [strip for strip in strips if not strip.numeric and strip.column.short is None]
    for some, least in ((prose, None), (names, NARROWEST_NAME)):
        for strip in sorted(some, key=lambda one: -one.width):
            excess = _total(strips) - width
            if excess > 0:
                lowest = max(strip.least if least is None else least, cells_wide(strip.column.heading))
                strip.width = max(strip.width - excess, min(lowest, strip.width))


def _total(strips: Sequence[_Strip]) -> int:
    return sum(strip.width + GAP for strip in strips) - GAP


def _least_total(strips: Sequence[_Strip]) -> int:
    return sum(strip.least + GAP for strip in strips) - GAP


def _row_lines(cells: Sequence[str], strips: Sequence[_Strip]) -> list[str]:
    """A row, on more lines than one only where prose is broken."""
    parts = [
        _wrapped(cell, strip.width) if strip.column.prose == "wrap" else [_clipped(cell, strip.width)]
        for cell, strip in zip(cells, strips, strict=True)
    ]
    height = max(map(len, parts), default=0)
    return [_line([part[at] if at < len(part) else "" for part in parts], strips) for at in range(height)]


def _line(cells: Sequence[str], strips: Sequence[_Strip]) -> str:
    padded = [_padded(cell, strip.width, right=strip.numeric) for cell, strip in zip(cells, strips, strict=True)]
    return (" " * GAP).join(padded).rstrip()


def _padded(text: str, width: int, *, right: bool = False) -> str:
    space = " " * (width - cells_wide(text))
    return space + text if right else text + space


def _wrapped(text: str, width: int) -> list[str]:
    """A text in lines that end between words; a word that is longer than a line is not broken."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".lstrip()
        if lines[-1] and cells_wide(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _clipped(text: str, width: int) -> str:
    """The beginning of a text that is too long, to the end of a word if that takes no more than half of it."""
    if cells_wide(text) <= width:
        return text
    from rich.cells import set_cell_size

    beginning = set_cell_size(text, width - 1).rstrip()
    words, space, _ = beginning.rpartition(" ")
    return f"{words if space and 2 * cells_wide(words) >= width else beginning}…"
