"""Which networks were trained on which versions: notes beside a dataset, in its side folder.

They are hints. A version does not hold them, so that training changes no dataset; a copy or the bucket may lack them;
and what a note names may be gone. Who reads one asks the run itself.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from handsight.datasets.atomic import atomic_file, is_unfinished
from handsight.datasets.format.checks import text
from handsight.datasets.store.repository import GraspRepository

NOTES_FOLDER = "runs"
"""In the side folder: a file for every network that was trained on the dataset."""

_LARGEST_NOTE_BYTES = 1 << 16
_VALUE = text(4096)


@dataclass(frozen=True, slots=True, kw_only=True)
class NotedVersion:
    """A version that a network was trained on, and by which picture."""

    ref: str
    snapshot: str
    view: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RunNote:
    """A network that was trained on versions of the dataset."""

    run: str
    """Absolute path of its folder, on the machine that trained it."""
    weights_sha256: str
    created: str
    """UTC, ISO 8601."""
    versions: tuple[NotedVersion, ...]


def write_note(repository: GraspRepository, note: RunNote) -> None:
    """Note a network, in place of what was noted of the same weights in the same folder.

    Raises:
        OSError: Nothing can be written there.
    """
    folder = repository.side_folder / NOTES_FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    place = hashlib.sha256(note.run.encode(errors="surrogateescape")).hexdigest()[:8]
    with atomic_file(folder / f"{note.weights_sha256[:16]}-{place}.json") as unfinished:
        unfinished.write_text(json.dumps(asdict(note), indent=2) + "\n", encoding="utf-8")


def notes_of(repository: GraspRepository, snapshot_id: str) -> list[RunNote]:
    """What is noted of a snapshot, the oldest first. Notes that are damaged or cannot be read are left out."""
    try:
        paths = [one for one in (repository.side_folder / NOTES_FOLDER).glob("*.json") if not is_unfinished(one)]
    except OSError:
        return []
    notes = [note for path in paths if (note := _read(path)) is not None]
    of_it = [note for note in notes if any(one.snapshot == snapshot_id for one in note.versions)]
    return sorted(of_it, key=lambda note: (note.created, note.run))


def _read(path: Path) -> RunNote | None:
    try:
        if path.stat().st_size > _LARGEST_NOTE_BYTES:
            return None
        return _parse(json.loads(path.read_bytes()))
    except (OSError, ValueError, RecursionError, KeyError, TypeError):
        return None


def _parse(values: Any) -> RunNote | None:
    versions = [[one[name] for name in ("ref", "snapshot", "view")] for one in values["versions"]]
    run, weights, created = (values[name] for name in ("run", "weights_sha256", "created"))
    if not _all_text([run, created, *(part for version in versions for part in version)]):
        return None
    if not (isinstance(weights, str) and re.fullmatch("[0-9a-f]{64}", weights)) or "\0" in run:
        return None
    return RunNote(
        run=run,
        weights_sha256=weights,
        created=created,
        versions=tuple(NotedVersion(ref=ref, snapshot=snapshot, view=view) for ref, snapshot, view in versions),
    )


def _all_text(values: Sequence[object]) -> bool:
    return all(_VALUE(value) is None for value in values)
