"""A CSV table of anybody's as lines of cells that know where in the file they stand. Reads text, understands none."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from handsight.datasets.errors import InterchangeError, counted
from handsight.datasets.format.typed import listed, shown
from handsight.datasets.machine import of_the_machine

_OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "vertical bars"}


@dataclass(frozen=True, slots=True, kw_only=True)
class TableLine:
    """One line of a table."""

    number: int
    """Where it begins in the file, as an editor counts: from 1, the head and blank lines included."""
    cells: dict[str, str]
    """By column; optional columns that the table lacks are not there."""


def read_lines(path: Path, *, required: Sequence[str], optional: Sequence[str]) -> list[TableLine]:
    """Every line of a table that has the right columns. Blank lines, and lines of empty cells, are left out.

    Args:
        path: The table: UTF-8, cells separated by commas, the names of the columns in the first line.
        required: Columns that it must have.
        optional: Columns that it may have; any other is refused, to catch typos.

    Raises:
        InterchangeError: It is no such table; every fault is said, by line of the file.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(_numbered(csv.reader(file, strict=True)))
    except UnicodeDecodeError as error:
        raise InterchangeError(
            f"{path} is not UTF-8 ({error.reason} at byte {error.start}): save it as UTF-8"
        ) from error
    except OSError as error:
        if trouble := of_the_machine(f"{path} cannot be read", error):
            raise trouble from error
        raise InterchangeError(f"{path} cannot be read: {error.strerror or error}") from error
    except (ValueError, csv.Error) as error:
        raise InterchangeError(f"{path} cannot be read as a table: {error}") from error
    _, columns = rows[0] if rows else (1, [])
    faults = _column_faults(columns, required, optional)
    if not faults:
        faults += [
            f"line {number} has {counted(len(cells), 'cell')}, expected {len(columns)}"
            for number, cells in rows[1:]
            if len(cells) != len(columns)
        ]
    faults += ["there are no attempts"] * (len(rows) < 2)
    if faults:
        raise InterchangeError(f"{path} cannot be imported: {listed(faults)}")
    return [TableLine(number=number, cells=dict(zip(columns, cells, strict=True))) for number, cells in rows[1:]]


def _numbered(reader: Iterator[list[str]]) -> Iterator[tuple[int, list[str]]]:
    """Rows that are not blank, and the line each begins with: a quoted cell may reach over several."""
    begins = 1
    for row in reader:
        if any(cell.strip() for cell in row):
            yield begins, row
        begins = reader.line_num + 1  # type: ignore[attr-defined]  # Of csv.reader, whose type has no public name.


def _column_faults(columns: Sequence[str], required: Sequence[str], optional: Sequence[str]) -> list[str]:
    separator = _other_separator(columns, required)
    if separator:
        word = _OTHER_SEPARATORS[separator]
        return [
            f"its separator is {separator!r}, expected a comma: export it with commas instead of {word}, and with "
            "points in numbers"
        ]
    twice = [name for name, number in Counter(columns).items() if number > 1]
    missing = [name for name in required if name not in columns]
    unknown = [name for name in dict.fromkeys(columns) if name not in (*required, *optional)]
    faults = [f"columns stand more than once: {', '.join(map(shown, twice))}; keep one of each"] * bool(twice)
    faults += [f"columns are missing: {', '.join(missing)}"] * bool(missing)
    if unknown:
        names = ", ".join(map(shown, unknown[:10]))
        faults.append(f"columns are unknown: {names} (optional ones are {', '.join(optional)})")
    return faults


def _other_separator(columns: Sequence[str], required: Sequence[str]) -> str | None:
    """What separates the cells of a head in which no column is found, where something else than a comma does."""
    if set(columns) & set(required):
        return None
    head = ",".join(columns)
    found = [one for one in _OTHER_SEPARATORS if set(head.replace('"', "").split(one)) & set(required)]
    return found[0] if found else None
