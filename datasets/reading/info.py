"""What a dataset is, in a dozen numbers."""

from __future__ import annotations

from dataclasses import dataclass

from handsight.datasets.address import SIDE_FOLDER
from handsight.datasets.store.files import stored_files
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
    """Size of the folder or of what is in the bucket, with its whole history and without caches."""
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
    """Bytes in the files of a dataset, caches left out."""
    return sum(stored_files(repository.path, leave_out=SIDE_FOLDER).values())
