"""Bringing a dataset of an older schema forward, on a branch of its own.

The version that was migrated stays as it is, and every attempt keeps its id and its digest: columns that a schema
added hold nothing in older attempts, and what holds nothing does not enter a digest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zarr

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.branches import create_branch, delete_branch
from handsight.datasets.engine import array_at, engine_errors, group_at
from handsight.datasets.repository import GraspRepository
from handsight.datasets.schema import COLUMNS, SCHEMA_VERSION, SESSIONS, Slots, create_array
from handsight.datasets.sessions import attributes_with_header


@dataclass(frozen=True, slots=True, kw_only=True)
class Migration:
    """What a call of :func:`migrate` did."""

    branch: str
    snapshot: str
    """Tip of the new branch; the version itself where there was nothing to do."""
    schema_before: int
    schema_after: int
    sessions: int


def migrate(repository: GraspRepository, branch: str, *, ref: str = DEFAULT_REF) -> Migration | None:
    """Make a branch that begins at a version of an older schema and ends with the same content in the newest one.

    Returns None, and makes no branch, when the version has the newest schema already.

    Raises:
        RefNotFoundError: There is no such version.
        RefNameError: The branch's name is malformed or taken.
        CorruptDataError: What describes a session is damaged: repair cannot help, restore it from a copy.
    """
    before = schema_of(repository.root(repository.resolve(ref)))
    if before >= SCHEMA_VERSION:
        return None
    create_branch(repository, branch, ref)
    try:
        change = repository.writable(branch)
        with engine_errors(f"cannot migrate {repository.path}"):
            root = zarr.open_group(change.store, mode="r+")
            for version in range(before, SCHEMA_VERSION):
                _STEPS[version](root)
            root.update_attributes({"schema_version": SCHEMA_VERSION})
        message = f"migrate {ref} from schema {before} to {SCHEMA_VERSION}"
        snapshot = repository.commit(change, branch=branch, message=message)
    except BaseException:
        delete_branch(repository, branch, force=True)
        raise
    sessions = len(list(group_at(root, SESSIONS).group_keys()))
    return Migration(
        branch=branch, snapshot=snapshot, schema_before=before, schema_after=SCHEMA_VERSION, sessions=sessions
    )


def schema_of(root: zarr.Group) -> int:
    """The schema version of a snapshot."""
    return int(str(root.attrs["schema_version"]))


def _add_conditions(root: zarr.Group) -> None:
    """1 to 2: stations name the conditions they vary, attempts hold their values and what a network predicted."""
    for _, session in group_at(root, SESSIONS).groups():
        attributes: dict[str, Any] = session.attrs.asdict()
        header = dict(attributes["header"])
        header["station"] = {**header["station"], "conditions": []}
        session.attrs.put(attributes_with_header(attributes, header))
        _add_columns(session, since=2)


def _add_columns(session: zarr.Group, *, since: int) -> None:
    """Add the columns that a schema brought. They hold fill values, of which nothing is stored."""
    numbers = array_at(session, "attempts/number")
    slots = Slots(objects=array_at(session, "attempts/catalogue_index").shape[1], conditions=1)
    attempts = group_at(session, "attempts")
    for column in COLUMNS:
        if column.since == since:
            row = column.shape(slots)
            create_array(
                attempts,
                column.name,
                dtype=column.dtype,
                row=row,
                rows=numbers.chunks[0],
                fill=column.fill,
                attributes={"unit": column.unit, "description": column.description},
            )
            array_at(attempts, column.name).resize((numbers.shape[0], *row))


_STEPS: dict[int, Callable[[zarr.Group], None]] = {1: _add_conditions}
"""What brings a dataset from a schema to the next."""
