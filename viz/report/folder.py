"""What a folder holds that a report can tell of, such as one that ``handsight demo`` leaves."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handsight.datasets.address import looks_like_dataset
from handsight.datasets.errors import counted
from handsight.training.run_folder import RUN_RECORD
from handsight.viz.errors import ReportError
from handsight.viz.report.content import Block, Figure, Note, Section, Table, shown_rows
from handsight.viz.report.embedding import embedded_file
from handsight.viz.report.evaluation_file import check_evaluation, is_evaluation, read_json

PLAN = "plan.json"
"""By which a folder is known as that of a sweep."""
PICTURES = (".png", ".jpg", ".jpeg")
PICTURE_WIDTH_PX = 1200
MOST_PICTURES = 12
MOST_ENTRIES = 1000
"""Of the folder: it is no place for a whole disk."""
_REDRAWN = ("results.png", "figure7.png")
"""Pictures that a report draws itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderContents:
    """What there is in a folder and one level below it, each sorted by name."""

    datasets: tuple[Path, ...] = ()
    runs: tuple[Path, ...] = ()
    sweeps: tuple[Path, ...] = ()
    evaluations: tuple[tuple[Path, dict[str, Any]], ...] = ()
    recordings: tuple[Path, ...] = ()
    pictures: tuple[Path, ...] = ()


def folder_contents(folder: Path) -> FolderContents:
    """Look at what a folder holds.

    Raises:
        ReportError: There is nothing of which a report can tell, too much, or a damaged evaluation.
        OSError: The folder cannot be listed.
    """
    entries = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    if len(entries) > MOST_ENTRIES:
        raise ReportError(
            f"{folder} holds {counted(len(entries), 'entry', 'entries')}, expected at most {MOST_ENTRIES}: name a "
            "folder below it"
        )
    # Runs are mostly kept together in a folder of their own.
    folders = [one for path in entries if path.is_dir() for one in (path, *_below(path))]
    files = [path for path in entries if path.is_file()]
    found = FolderContents(
        datasets=tuple(path for path in folders if looks_like_dataset(path)),
        runs=tuple(path for path in folders if (path / RUN_RECORD).is_file()),
        sweeps=tuple(path for path in folders if is_sweep(path)),
        evaluations=tuple(_evaluations(files)),
        recordings=tuple(path for path in files if path.suffix.lower() == ".rrd"),
        pictures=tuple(path for path in files if path.suffix.lower() in PICTURES and path.name.lower() not in _REDRAWN),
    )
    if found == FolderContents():
        raise ReportError(
            f"{folder} holds nothing that a report can tell of, expected a dataset, a run, a sweep, or what "
            "'handsight demo' leaves: name one of these"
        )
    return found


def is_sweep(folder: Path) -> bool:
    """Whether a folder has the plan of a sweep."""
    return (folder / PLAN).is_file() and (folder / "cells").is_dir()


def files_section(found: FolderContents) -> Section | None:
    """Recordings, with how to open them, and pictures of a folder; None where there are neither."""
    parts: list[Section] = []
    if found.recordings:
        rows, left = shown_rows(
            tuple(
                (path.name, f"{path.stat().st_size / 1e6:.1f} MB", shlex.join(("rerun", str(path))))
                for path in found.recordings
            ),
            MOST_ENTRIES,
        )
        table = Table(
            caption=f"{counted(len(found.recordings), 'recording')} for the Rerun viewer{left}",
            head=("file", "size", "to open it"),
            rows=rows,
            prose=frozenset({2}),
        )
        parts.append(Section(title="Recordings", blocks=(table,)))
    if found.pictures:
        parts.append(Section(title="Pictures", blocks=tuple(_pictures(found.pictures))))
    return Section(title="Files", parts=tuple(parts)) if parts else None


def _pictures(paths: tuple[Path, ...]) -> Iterator[Block]:
    for path in paths[:MOST_PICTURES]:
        try:
            picture = embedded_file(path, width_px=PICTURE_WIDTH_PX)
        except ReportError as error:
            yield Note(text=str(error))
            continue
        yield Figure(picture=picture, alt=f"The picture {path.name} of the folder.", caption=path.name)
    if len(paths) > MOST_PICTURES:
        yield Note(text=f"{counted(len(paths) - MOST_PICTURES, 'picture')} more are left out.")


def _below(folder: Path) -> list[Path]:
    """Folders in one that is nothing itself."""
    if looks_like_dataset(folder) or (folder / RUN_RECORD).is_file() or is_sweep(folder):
        return []
    below = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
    return below[:MOST_ENTRIES]


def _evaluations(files: list[Path]) -> Iterator[tuple[Path, dict[str, Any]]]:
    for path in files:
        if path.suffix.lower() == ".json":
            values = read_json(path)
            if is_evaluation(values):
                check_evaluation(path, values)
                yield path, values
