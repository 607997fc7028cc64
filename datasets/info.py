"""What a dataset is, in a dozen numbers."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from handsight.datasets.repository import SIDE_FOLDER


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetInfo:
    """A summary of one version of a dataset."""

    attempts: int
    successes: int
    excluded: int
    """Attempts that curation has set aside."""
    snapshot: str
    ref: str
    """The release, branch or snapshot id by which the version was opened."""
    schema_version: int
    bytes: int
    """Size of the folder on disk, with its whole history and without caches."""
    digest: str
    """SHA-256 of the content of all attempts; the same however they were committed."""
    sessions: int
    outcomes: dict[str, int]
    """Attempts by outcome, every outcome listed."""
    objects: dict[str, int]
    """Attempts by target object, every object of the sessions' catalogues listed, sorted."""


def bytes_on_disk(folder: Path) -> int:
    """Bytes in the files of a dataset, caches left out."""
    total = 0
    for parent, folders, files in os.walk(folder):
        if Path(parent) == folder and SIDE_FOLDER in folders:
            folders.remove(SIDE_FOLDER)
        total += sum((Path(parent) / name).stat().st_size for name in files)
    return total
