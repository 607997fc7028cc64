"""What commands print: text for people or one JSON value for programs, and progress on standard error."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

console = Console(highlight=False, soft_wrap=True)
"""Standard output. Wide when it is no terminal: a pipe should not see wrapped tables."""
if not console.is_terminal:
    console.width = 240
errors = Console(stderr=True, highlight=False)


def print_json(value: Any) -> None:
    """One JSON value on standard output; dataclasses, times, paths and numpy numbers included."""
    sys.stdout.write(json.dumps(value, indent=2, default=_plain) + "\n")


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no form in JSON")


def print_table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, title: str | None = None) -> None:
    """A table; the first column is never wrapped, columns of numbers are aligned right."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for index, name in enumerate(columns):
        numeric = bool(rows) and all(row[index].lstrip("-")[:1].isdigit() or row[index] in ("", "-") for row in rows)
        table.add_column(escape(name), justify="right" if numeric else "left", no_wrap=index == 0, overflow="fold")
    for row in rows:
        table.add_row(*map(escape, row))
    console.print(table)


class Bar:
    """One progress bar; silent when standard error is no terminal."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        self._progress = progress
        self._task = task

    def advance(self, note: str = "") -> None:
        """One more is done."""
        self._progress.update(self._task, advance=1, note=note)

    def reached(self, count: int, note: str = "") -> None:
        """So many are done now."""
        self._progress.update(self._task, completed=count, note=note)

    def of(self, count: int, total: int) -> None:
        """So many of a total that became known only now are done."""
        self._progress.update(self._task, completed=count, total=total)


@contextmanager
def progress_bar(label: str, total: int) -> Iterator[Bar]:
    """Show a bar on standard error while the block runs."""
    progress = Progress(
        TextColumn("[bold]{task.description:<10}"),
        BarColumn(bar_width=32),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
        console=errors,
        disable=not errors.is_terminal,
    )
    with progress:
        yield Bar(progress, progress.add_task(label, total=total, note=""))
