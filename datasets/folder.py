"""The folder of a dataset: what may be there before, and what is there from the start."""

from __future__ import annotations

import uuid
from pathlib import Path

import icechunk
import zarr

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.engine import engine_config, local_storage, sync_file_system
from handsight.datasets.errors import DatasetExistsError, NotADatasetError, SchemaError
from handsight.datasets.provenance import utc_now
from handsight.datasets.releases import LEDGER_BRANCH
from handsight.datasets.schema import SCHEMA_VERSION, SESSIONS


def is_engine_folder(path: Path) -> bool:
    """Whether an Icechunk store, ours or not, is in the folder. Writes nothing."""
    # Icechunk creates the folder it is asked about, so it is asked only about folders that look like its own.
    return (path / "refs").is_dir() and icechunk.Repository.exists(local_storage(path))


def refuse_occupied(path: Path) -> None:
    """Refuse a place where a new dataset cannot be made.

    Raises:
        DatasetExistsError: There is a dataset already.
        NotADatasetError: There is a file, or a folder with something else in it.
    """
    if path.is_dir():
        if is_engine_folder(path):
            raise DatasetExistsError(f"there is a dataset at {path} already: open it, or choose another path")
        if any(path.iterdir()):
            raise NotADatasetError(f"{path} is a folder with other files in it: choose a new or an empty folder")
    elif path.exists():
        raise NotADatasetError(f"{path} is a file, expected a new or an empty folder")


def write_empty(path: Path) -> None:
    """Make a dataset without attempts in a folder that does not exist yet, and sync it to disk."""
    path.mkdir()
    repository = icechunk.Repository.create(local_storage(path), engine_config())
    session = repository.writable_session(DEFAULT_REF)
    attributes = {"schema_version": SCHEMA_VERSION, "dataset_uuid": str(uuid.uuid4()), "created": utc_now()}
    zarr.create_group(session.store, attributes=attributes).create_group(SESSIONS)
    snapshot_id = session.commit("create the dataset")
    repository.create_branch(LEDGER_BRANCH, snapshot_id)
    sync_file_system(path)


def check_schema(path: Path, version: object) -> None:
    """Refuse what this handsight cannot read; ``version`` is the root's ``schema_version``, None where it has none.

    Raises:
        NotADatasetError: The store was not written by handsight.
        SchemaError: It was written by a newer one.
    """
    if not isinstance(version, int):
        raise NotADatasetError(f"{path} was not written by handsight (its root has no schema_version): check the path")
    if version > SCHEMA_VERSION:
        raise SchemaError(
            f"{path} has schema version {version}, this handsight reads up to {SCHEMA_VERSION}: upgrade handsight"
        )
