"""Runs below some folders, each with its figures or with what is wrong with it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from handsight.datasets.address import looks_like_dataset
from handsight.training.errors import CheckpointError
from handsight.training.run_figures import RunFigures, figures_of
from handsight.training.run_folder import RUN_RECORD
from handsight.training.run_record import read_values

DEEPEST = 5
"""Folders below the one that is named, at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedRun:
    """A run that was found. It has either figures or a fault."""

    run: str
    """Its folder, beginning as the one that was named."""
    figures: RunFigures | None
    fault: str | None
    """Why it cannot be read."""


def list_runs(folders: Sequence[Path]) -> list[ListedRun]:
    """The runs in and below some folders, each once, by the time at which they were written; damaged ones last.

    Raises:
        CheckpointError: A folder is not there.
    """
    missing = [str(folder) for folder in folders if not folder.is_dir()]
    if missing:
        raise CheckpointError(f"there is no folder {', '.join(missing)}: name folders that runs are in or below")
    found: dict[Path, Path] = {}
    for folder in folders:
        for path in _run_folders(folder, DEEPEST):
            found.setdefault(path.resolve(), path)
    listed = [_read(path) for path in found.values()]
    return sorted(listed, key=lambda one: (one.figures is None, (one.figures and one.figures.created) or "", one.run))


def _run_folders(folder: Path, depth: int) -> Iterator[Path]:
    """Folders with a record, the one at hand first. Nothing below a run or in a dataset is one."""
    if (folder / RUN_RECORD).is_file():
        yield folder
        return
    if not depth or looks_like_dataset(folder):
        return
    below: list[str] = []
    with suppress(OSError), os.scandir(folder) as entries:  # What may not be read holds no run that could be.
        below = [one.name for one in entries if not one.name.startswith(".") and one.is_dir(follow_symlinks=False)]
    for name in sorted(below):
        yield from _run_folders(folder / name, depth - 1)


def _read(folder: Path) -> ListedRun:
    try:
        return ListedRun(run=str(folder), figures=figures_of(read_values(folder / RUN_RECORD)), fault=None)
    except CheckpointError as error:
        return ListedRun(run=str(folder), figures=None, fault=str(error))
    except OSError as error:
        return ListedRun(run=str(folder), figures=None, fault=f"{folder / RUN_RECORD}: {error.strerror or error}")
