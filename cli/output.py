"""What commands print: text for people or one JSON value for programs, and progress on standard error.

Rich is imported with the first line that is printed: a refusal prints none, and ``--help`` needs none.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

Piece = str | tuple[str, str]
"""Part of a line: a text, or a text with its style; neither is ever read as markup."""


def bold(text: object) -> Piece:
    """A part of a line that stands out."""
    return str(text), "bold"


class Output:
    """Standard output or standard error."""

    def __init__(self, **settings: Any) -> None:
        self._settings = settings

    @cached_property
    def rich(self) -> Console:
        """Rich's console."""
        from rich.console import Console

        return Console(highlight=False, **self._settings)

    def print(self, *pieces: Piece) -> None:
        """Print one line made of pieces, each as it is written: names and paths may hold what looks like markup.

        The line is not broken: the terminal does that, and what is copied from there is whole.
        """
        from rich.text import Text

        self.rich.print(Text.assemble(*pieces), soft_wrap=True)


console = Output()
errors = Output(stderr=True)


def print_json(value: Any) -> None:
    """One JSON value on standard output; dataclasses, times, paths and numpy numbers included."""
    sys.stdout.write(json.dumps(value, indent=2, default=_plain) + "\n")
    sys.stdout.flush()  # Whoever reads it from a command that goes on waits for it.


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
        TextColumn("{task.fields[note]}", markup=False),
        console=errors.rich,
        disable=not errors.rich.is_terminal,
    )
    with progress:
        yield Bar(progress, progress.add_task(label, total=total, note=""))
