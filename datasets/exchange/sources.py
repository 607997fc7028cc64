"""Sessions as they come from anywhere: another dataset, a foreign file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from typing import Any

import zarr
from ulid import ULID

from handsight.datasets.errors import HeaderError, InterchangeError, counted
from handsight.datasets.format.arrays import array_at, group_at, read_range
from handsight.datasets.format.frames import BATCH_FRAMES, frame_arrays, read_frames
from handsight.datasets.format.header import config_digest
from handsight.datasets.format.provenance import utc_now
from handsight.datasets.format.rows import from_row
from handsight.datasets.format.schema import (
    COLUMN_CHUNK_ROWS,
    SCHEMA_VERSION,
    SESSIONS,
    VIEWPOINTS,
    ColumnWidths,
    column_widths,
)
from handsight.datasets.format.sessions import SessionInfo, session_from_attributes
from handsight.datasets.format.typed import listed, shown
from handsight.datasets.format.upgrades import columns_of, current_attributes, empty_columns
from handsight.datasets.format.validation import header_faults, json_faults
from handsight.datasets.records import GraspAttempt, SessionHeader
from handsight.datasets.writing.batches import EncodedAttempt


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSource:
    """One session to be transferred. What the attributes say has been checked, what the attempts hold has not."""

    ulid: str
    header: SessionHeader
    attributes: dict[str, Any]
    """Of the session's group, see ``sessions.py``."""
    digests: tuple[bytes, ...]
    """Recorded digest of every attempt, 32 bytes each; empty where the source has none."""
    size: int
    """Number of attempts."""
    attempts: Callable[[], Iterator[GraspAttempt]]
    """Reads the attempts, in the order of their numbers."""
    encoded: Callable[[], Iterator[EncodedAttempt]] | None = None
    """Gives the same attempts checked, hashed and encoded, where that was done already; None otherwise."""


def checked_source(
    ulid: str,
    attributes: dict[str, Any],
    *,
    size: int,
    attempts: Callable[[], Iterator[GraspAttempt]] = lambda: iter(()),
    digests: tuple[bytes, ...] = (),
) -> SessionSource:
    """A source whose identity and attributes are sound; how to read its attempts may be added later.

    Raises:
        InterchangeError: They are not; the message lists every fault.
    """
    if not _is_ulid(ulid):
        raise InterchangeError(f"session {shown(ulid)} was not written by handsight: expected a ULID as its name")
    try:
        info = session_from_attributes(ulid, attributes, attempts=size)
    except HeaderError as error:
        raise InterchangeError(f"session {ulid} was not written by handsight: {error}") from error
    faults = header_faults(info.header) or _attribute_faults(info, attributes)
    if digests and len(digests) != size:
        faults.append(f"it has {counted(len(digests), 'digest')} for {counted(size, 'attempt')}")
    if faults:
        raise InterchangeError(f"session {ulid} cannot be imported: {listed(faults)}")
    return SessionSource(
        ulid=ulid, header=info.header, attributes=attributes, digests=digests, size=size, attempts=attempts
    )


def _is_ulid(text: object) -> bool:
    try:
        return isinstance(text, str) and str(ULID.from_str(text)) == text
    except ValueError:
        return False


def _attribute_faults(info: SessionInfo, attributes: dict[str, Any]) -> list[str]:
    """What is wrong beside the header, which is sound."""
    faults = []
    if info.config_digest != config_digest(info.header):
        faults.append("config_digest does not belong to the header: it was changed after it was recorded")
    for name, moment in (("started", info.started), ("ended", info.ended)):
        if moment is not None and not _is_moment(moment):
            faults.append(f"{name} is {shown(moment)}, expected a time in ISO 8601 such as {utc_now()}")
    return faults + json_faults("the attributes", attributes)


def _is_moment(text: str) -> bool:
    try:
        datetime.fromisoformat(text)
    except ValueError:
        return False
    return True


def stored_source(group: zarr.Group, ulid: str, schema: int) -> SessionSource:
    """A session in a Zarr hierarchy of a schema, as today's schema has it.

    Raises:
        InterchangeError: The group is no session.
        CorruptDataError: An array is damaged or missing.
    """
    size = array_at(group, "attempts/number").shape[0]
    digests = read_range(array_at(group, "attempts/digest"), 0, size)
    source = checked_source(
        ulid,
        _current_attributes(group, ulid, schema),
        size=size,
        digests=tuple(digest.tobytes() for digest in digests),
    )
    return replace(source, attempts=partial(read_attempts, group, size, column_widths(source.header), schema))


def _current_attributes(group: zarr.Group, ulid: str, schema: int) -> dict[str, Any]:
    try:
        return current_attributes(group.attrs.asdict(), schema)
    except HeaderError as error:
        raise InterchangeError(f"session {ulid} was not written by handsight: {error}") from error


def stored_sources(root: zarr.Group, schema: int = SCHEMA_VERSION) -> list[SessionSource]:
    """All sessions of a Zarr hierarchy of a schema, in the order in which they began."""
    sessions = group_at(root, SESSIONS)
    return [stored_source(group_at(sessions, ulid), ulid, schema) for ulid in sorted(sessions.group_keys())]


def read_attempts(group: zarr.Group, size: int, widths: ColumnWidths, schema: int) -> Iterator[GraspAttempt]:
    """The attempts of a session in the order of their numbers, a few frames in memory at a time.

    Raises:
        CorruptDataError: An array is damaged or missing.
    """
    columns = {column.name: array_at(group, f"attempts/{column.name}") for column in columns_of(schema)}
    arrays = {viewpoint: frame_arrays(group, viewpoint) for viewpoint in VIEWPOINTS}
    for start in range(0, size, COLUMN_CHUNK_ROWS):
        stop = min(start + COLUMN_CHUNK_ROWS, size)
        rows = {name: read_range(array, start, stop) for name, array in columns.items()}
        rows |= empty_columns(schema, stop - start, widths)
        for first in range(start, stop, BATCH_FRAMES):
            last = min(first + BATCH_FRAMES, stop)
            frames = {viewpoint: read_frames(arrays[viewpoint], viewpoint, first, last) for viewpoint in VIEWPOINTS}
            for number in range(first, last):
                row = {name: values[number - start] for name, values in rows.items()}
                taken = dict(zip(VIEWPOINTS, row["picture_taken"], strict=True))
                yield from_row(
                    row,
                    {
                        viewpoint: frames[viewpoint][number - first] if taken[viewpoint] else None
                        for viewpoint in VIEWPOINTS
                    },
                )
