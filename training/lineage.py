"""From a version of a dataset to the runs that were trained on it; without PyTorch."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from handsight.datasets.errors import DatasetError
from handsight.training.errors import CheckpointError
from handsight.training.run_folder import NEXT_WEIGHTS, RUN_RECORD, WEIGHTS
from handsight.training.run_record import WEIGHTS_SHA256, origins_of, read_values

if TYPE_CHECKING:
    # Icechunk takes a second; who calls this has a version open.
    from handsight.datasets.reading.reader import GraspDataset


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownRun:
    """A run that is noted beside a dataset."""

    run: str
    """Its folder, when it was trained."""
    weights_sha256: str
    created: str
    """UTC, ISO 8601."""
    exists: bool
    """Whether that folder still holds a run with these weights."""


def note_run(folder: Path, datasets: Mapping[str, GraspDataset]) -> None:
    """Note a run that was saved beside each dataset that it was trained on.

    That a note cannot be written, as beside a dataset that is read-only, is no fault of the run: nothing is said.

    Args:
        folder: Of the run.
        datasets: What it was trained on, by the names that its origins have.
    """
    from handsight.datasets.store.run_notes import NotedVersion, RunNote, write_note

    with suppress(OSError, CheckpointError):
        record = read_values(folder / RUN_RECORD)
        repositories = {str(one.repository.path): one.repository for one in datasets.values()}
        for path, repository in repositories.items():
            versions = tuple(
                NotedVersion(ref=origin["ref"], snapshot=origin["snapshot"], view=origin["view"])
                for origin in origins_of(record)
                if origin["dataset"] in datasets and str(datasets[origin["dataset"]].repository.path) == path
            )
            note = RunNote(
                run=str(folder.absolute()),
                weights_sha256=record[WEIGHTS_SHA256],
                created=record["created"],
                versions=versions,
            )
            with suppress(OSError, DatasetError):
                write_note(repository, note)


def runs_trained_on(dataset: GraspDataset) -> list[KnownRun]:
    """The runs that were trained on this version, by any of its names, the oldest first."""
    from handsight.datasets.store.run_notes import notes_of

    return [
        KnownRun(
            run=note.run,
            weights_sha256=note.weights_sha256,
            created=note.created,
            exists=_holds(Path(note.run), note.weights_sha256),
        )
        for note in notes_of(dataset.repository, dataset.snapshot_id)
    ]


def _holds(folder: Path, weights_sha256: str) -> bool:
    """Whether a folder holds a run whose record names these weights."""
    try:
        named = read_values(folder / RUN_RECORD).get(WEIGHTS_SHA256)
        return named == weights_sha256 and any((folder / name).is_file() for name in (WEIGHTS, NEXT_WEIGHTS))
    except (OSError, CheckpointError, ValueError):
        return False
