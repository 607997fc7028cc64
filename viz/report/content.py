"""What a report is made of, before it is HTML: sections of facts, tables, pictures and notes.

Everything here is plain text; markup in it, such as in the name of an object, is shown as it is written.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from handsight.viz.report.embedding import Embedded


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """Names and values, one pair a line."""

    kind: ClassVar[str] = "facts"
    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """A paragraph."""

    kind: ClassVar[str] = "note"
    text: str
    command: str = ""
    """The call that says the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Statements, one a line."""

    kind: ClassVar[str] = "points"
    texts: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Rows under a head; the first cell of each names it."""

    kind: ClassVar[str] = "table"
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    prose: frozenset[int] = frozenset()
    """Columns whose cells are words; all others but the first are set as numbers."""
    command: str = ""
    """The call that prints the same."""
    folded: bool = False
    """Whether it is closed until somebody opens it, as long tables are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A picture with what it shows in words."""

    kind: ClassVar[str] = "figure"
    picture: Embedded
    alt: str
    """What is to be seen, for whoever cannot see it."""
    caption: str
    command: str = ""
    """The call that draws it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gallery:
    """Small pictures beside each other."""

    kind: ClassVar[str] = "gallery"
    title: str = ""
    """Its heading; empty where that of the section says it."""
    text: str
    """What is shown, and how it was chosen."""
    pictures: tuple[Figure, ...]
    command: str = ""


Block = Facts | Note | Points | Table | Figure | Gallery


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of a report under its heading."""

    title: str
    blocks: tuple[Block, ...] = ()
    parts: tuple[Section, ...] = ()
    """Sections one level below."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A whole report."""

    title: str
    summary: str
    """One sentence: what it is about."""
    command: str
    """The call that makes it."""
    handsight: str
    """The version that made it."""
    sections: tuple[Section, ...]


def shown_rows(rows: tuple[tuple[str, ...], ...], most: int) -> tuple[tuple[tuple[str, ...], ...], str]:
    """The first of many rows, and how many were left out, in words; a report is for reading, not for storing."""
    left = len(rows) - most
    return (rows, "") if left <= 0 else (rows[:most], f"; {left} more are left out")
