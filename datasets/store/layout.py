"""The location of a dataset: what may be there before, and what is there from the start."""

from __future__ import annotations

import uuid

import icechunk
import zarr

from handsight.datasets.address import DEFAULT_REF, Location, S3Prefix, refuse_unreachable
from handsight.datasets.errors import DatasetExistsError, NotADatasetError, SchemaError, pasteable
from handsight.datasets.format.provenance import utc_now
from handsight.datasets.format.schema import SCHEMA_VERSION, SESSIONS
from handsight.datasets.store.icechunk_engine import icechunk_config, open_store, storage_at, sync_file_system
from handsight.datasets.store.releases import LEDGER_BRANCH
from handsight.datasets.writable import link_fault

FIRST_COMMIT = "create the dataset"
"""Message of the commit that every dataset begins with."""


def refuse_occupied(path: Location) -> None:
    """Refuse a location where a new dataset cannot be made.

    Raises:
        DatasetExistsError: There is a dataset already.
        NotADatasetError: There is a file, a link that leads nowhere, or a folder with something else in it.
        AddressError: A dataset of that name could not be opened.
    """
    refuse_unreachable(path)
    if isinstance(path, S3Prefix) or path.is_dir():
        if open_store(path) is not None:
            raise DatasetExistsError(f"there is a dataset at {path} already: open it, or choose another path")
        if not isinstance(path, S3Prefix) and any(path.iterdir()):
            raise NotADatasetError(f"{path} is a folder with other files in it: choose a new or an empty folder")
    elif (fault := link_fault(path)) is not None:
        raise NotADatasetError(f"{fault}: mend the link, or remove it")
    elif path.exists():
        raise NotADatasetError(f"{path} is a file, expected a new or an empty folder")


def write_empty(path: Location) -> None:
    """Make a dataset without attempts where there is nothing yet, and sync it to disk."""
    repository = icechunk.Repository.create(storage_at(path), icechunk_config())
    transaction = repository.writable_session(DEFAULT_REF)
    attributes = {"schema_version": SCHEMA_VERSION, "dataset_uuid": str(uuid.uuid4()), "created": utc_now()}
    zarr.create_group(transaction.store, attributes=attributes).create_group(SESSIONS)
    snapshot_id = transaction.commit(FIRST_COMMIT)
    repository.create_branch(LEDGER_BRANCH, snapshot_id)
    sync_file_system(path)


def check_schema(path: Location, version: object) -> None:
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


def check_current(path: Location, ref: str, root: zarr.Group) -> None:
    """Refuse a version of another schema than this handsight writes, older ones included; ``root`` is its root group.

    Raises:
        NotADatasetError: The store was not written by handsight.
        SchemaError: It has another schema.
    """
    version = root.attrs.asdict().get("schema_version")
    check_schema(path, version)
    if version != SCHEMA_VERSION:
        raise SchemaError(
            f"{path}@{ref} has schema version {version}, and this handsight works with {SCHEMA_VERSION}; "
            f"{path}@schema-{SCHEMA_VERSION} will be the version to use, and the old one stay as it is, after "
            f"{pasteable('handsight', 'dataset', 'migrate', f'{path}@{ref}', '--branch', f'schema-{SCHEMA_VERSION}')}"
        )
