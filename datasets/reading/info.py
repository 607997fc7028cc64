"""What a dataset is, in a dozen numbers."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from handsight.datasets.address import SIDE_FOLDER, S3Prefix
from handsight.datasets.store.repository import GraspRepository


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetInfo:
    """A summary of one version of a dataset."""

    attempts: int
    """All that were recorded, excluded ones among them."""
    successes: int
    """Attempts with the label success, as curated, that are not excluded."""
    excluded: int
    """Attempts that curation has set aside."""
    snapshot: str
    ref: str
    """The release, branch or snapshot id by which the version was opened."""
    schema_version: int
    bytes: int
    """Size of the folder on disk, with its whole history and without caches."""
    digest: str
    """SHA-256 of the content of all attempts as recorded; the same however they were committed or curated."""
    curation_digest: str
    """SHA-256 of which attempts are excluded or relabelled, and how."""
    sessions: int
    outcomes: dict[str, int]
    """Attempts by recorded outcome, every outcome listed."""
    objects: dict[str, int]
    """Attempts by target object, every object of the sessions' catalogues listed, sorted."""


def bytes_stored(repository: GraspRepository) -> int:
    """Bytes in the files of a dataset, caches left out; in a bucket, only those of its chunks."""
    folder = repository.path
    if isinstance(folder, S3Prefix):
        return int(repository.icechunk_repository.chunk_storage_stats().native_bytes)
    total = 0
    for parent, folders, files in os.walk(folder):
        if Path(parent) == folder and SIDE_FOLDER in folders:
            folders.remove(SIDE_FOLDER)
        total += sum(_size(Path(parent) / name) for name in files)
    return total


def _size(file: Path) -> int:
    """0 for a file that went away since it was listed: a writer at work renames its files when they are whole."""
    try:
        return file.stat().st_size
    except FileNotFoundError:
        return 0
