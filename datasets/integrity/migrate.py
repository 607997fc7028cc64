"""Upgrading a dataset of an older schema, on a branch of its own.

The version that was migrated stays as it is, and every attempt keeps its id and its digest; see format/upgrades.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import zarr

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.format.arrays import array_at, group_at
from handsight.datasets.format.schema import SCHEMA_VERSION, SESSIONS, ColumnWidths, create_column
from handsight.datasets.format.upgrades import columns_since, current_attributes
from handsight.datasets.store.branches import check_new_branch, new_branch
from handsight.datasets.store.icechunk_engine import icechunk_errors
from handsight.datasets.store.repository import GraspRepository


@dataclass(frozen=True, slots=True, kw_only=True)
class Migration:
    """What a call of :func:`migrate` did."""

    branch: str
    snapshot: str | None
    """Tip of the new branch; None where it was only tried."""
    schema_before: int
    schema_after: int
    sessions: int


def migrate(
    repository: GraspRepository, branch: str, *, ref: str = DEFAULT_REF, dry_run: bool = False
) -> Migration | None:
    """Make a branch that begins at a version of an older schema and ends with the same content in the newest one.

    Returns None, and makes no branch, when the version has the newest schema already. With ``dry_run`` nothing is made.

    Raises:
        RefNotFoundError: There is no such version.
        RefNameError: The branch's name is malformed or taken.
        CorruptDataError: What describes a session is damaged: repair cannot help, restore it from a copy.
    """
    version = repository.root(repository.resolve(ref))
    before = schema_of(version)
    if before >= SCHEMA_VERSION:
        return None
    if dry_run:
        check_new_branch(repository, branch)
        return _migration(branch, None, before, len(list(group_at(version, SESSIONS).groups())))
    with new_branch(repository, branch, ref, what=f"migrate to {branch}") as draft:
        transaction = repository.writable(draft)
        with icechunk_errors(f"cannot migrate {repository.path}"):
            root = zarr.open_group(transaction.store, mode="r+")
            sessions = [session for _, session in group_at(root, SESSIONS).groups()]
            for session in sessions:
                _upgrade(session, before)
            root.update_attributes({"schema_version": SCHEMA_VERSION})
        message = f"migrate {ref} from schema {before} to {SCHEMA_VERSION}"
        snapshot = repository.commit(transaction, branch=draft, message=message)
    return _migration(branch, snapshot, before, len(sessions))


def _migration(branch: str, snapshot: str | None, before: int, sessions: int) -> Migration:
    return Migration(
        branch=branch, snapshot=snapshot, schema_before=before, schema_after=SCHEMA_VERSION, sessions=sessions
    )


def schema_of(root: zarr.Group) -> int:
    """The schema version of a snapshot."""
    return int(str(root.attrs["schema_version"]))


def _upgrade(session: zarr.Group, schema: int) -> None:
    """Give a session today's attributes, and the columns it lacks: fill values, of which nothing is stored."""
    session.attrs.put(current_attributes(session.attrs.asdict(), schema))
    numbers = array_at(session, "attempts/number")
    widths = ColumnWidths(objects=array_at(session, "attempts/catalogue_index").shape[1], conditions=1)
    attempts = group_at(session, "attempts")
    for column in columns_since(schema):
        create_column(attempts, column, widths, rows=numbers.chunks[0])
        array_at(attempts, column.name).resize((numbers.shape[0], *column.shape(widths)))
