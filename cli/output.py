"""What commands print: text for people or one JSON value for programs, and progress on standard error.

Rich is imported with the first line that is printed: a refusal prints none, and ``--help`` needs none.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID


class Output:
    """Standard output or standard error, with Rich's markup."""

    def __init__(self, **settings: Any) -> None:
        self._settings = settings

    @cached_property
    def rich(self) -> Console:
        """Rich's console. Wide when it is no terminal: a pipe should not see wrapped tables."""
        from rich.console import Console

        made = Console(highlight=False, **self._settings)
        if not made.is_terminal and not made.stderr:
            made.width = 240
        return made

    def print(self, *objects: object, **options: Any) -> None:
        """Print a line; options are those of Rich's ``Console.print``."""
        self.rich.print(*objects, **options)


console = Output(soft_wrap=True)
errors = Output(stderr=True)


def escaped(text: object) -> str:
    """A text without markup: in a file's name, ``[bold]`` is a word in brackets."""
    from rich.markup import escape

    return escape(str(text))


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
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for index, name in enumerate(columns):
        numeric = bool(rows) and all(row[index].lstrip("-")[:1].isdigit() or row[index] in ("", "-") for row in rows)
        table.add_column(escaped(name), justify="right" if numeric else "left", no_wrap=index == 0, overflow="fold")
    for row in rows:
        table.add_row(*map(escaped, row))
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
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    progress = Progress(
        TextColumn("[bold]{task.description:<10}"),
        BarColumn(bar_width=32),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
        console=errors.rich,
        disable=not errors.rich.is_terminal,
    )
    with progress:
        yield Bar(progress, progress.add_task(label, total=total, note=""))
