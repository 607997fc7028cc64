"""Blocks of attempts on their way into the arrays of a session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from handsight.datasets.digest import attempt_digest
from handsight.datasets.engine import append_rows, array_at, end_with, group_at, read_rows
from handsight.datasets.errors import RecordError
from handsight.datasets.records import GraspAttempt, SessionHeader, Snapshot
from handsight.datasets.rows import snapshot_of, to_row
from handsight.datasets.schema import COLUMN_CHUNK_ROWS, COLUMNS, VIEWS, View, create_array, slots_of
from handsight.datasets.validation import attempt_faults

Columns = dict[str, NDArray[Any]]
"""The values of one attempt by the path of their array in the session's group: everything but the frames."""

LastChunks = Mapping[str, NDArray[Any]]
"""The rows of the last, unfinished chunk of every column, by its path in the session's group."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreparedAttempt:
    """A valid attempt, ready to be written."""

    columns: Columns
    snapshots: dict[View, Snapshot | None]


def prepare(attempt: GraspAttempt, header: SessionHeader, *, session: str, number: int) -> PreparedAttempt:
    """Check an attempt that is to have that number and compute its digest. Pictures are shared, not copied.

    Raises:
        RecordError: The attempt cannot be recorded; the message lists every fault.
    """
    faults = attempt_faults(attempt, header)
    if attempt.number != number:
        faults.insert(0, f"number is {attempt.number}, expected {number}")
    if faults:
        raise RecordError(f"attempt {attempt.number} of session {session} is refused: {'; '.join(faults)}")
    row = to_row(attempt, slots=slots_of(header))
    row["digest"] = np.frombuffer(attempt_digest(attempt, header.station), dtype=np.uint8)
    snapshots = {view: snapshot_of(attempt, view) for view in VIEWS}
    columns = {f"attempts/{name}": value for name, value in row.items()}
    poses = {f"{view}/pose_base_tool": _pose(snapshot) for view, snapshot in snapshots.items()}
    return PreparedAttempt(columns={**columns, **poses}, snapshots=snapshots)


def write_columns(
    group: zarr.Group, rows: Sequence[Columns], *, stored: int, last_chunks: LastChunks
) -> dict[str, NDArray[Any]]:
    """Append rows to every column of a session that holds ``stored``; returns the new last chunks."""
    stop = stored + len(rows)
    blocks, finished = [], {}
    for path in column_paths():
        array = array_at(group, path)
        start = chunk_start(stored, array.chunks[0])
        # Whole chunks from memory: a partial write would first read the last chunk back, at twice the time.
        block = [row[path] for row in rows]
        whole = np.concatenate([last_chunks[path], block]) if stored > start else np.stack(block)
        blocks.append((array, start, whole))
        finished[path] = whole[chunk_start(stop, array.chunks[0]) - start :]
    end_with(blocks)
    return finished


def write_pictures(group: zarr.Group, block: Sequence[PreparedAttempt], *, stored: int) -> None:
    """Append the frames; zarr compresses them on all cores. A frame never taken stays a fill value."""
    for view in VIEWS:
        blocks = []
        for name in ("rgb", "depth"):
            array = array_at(group, f"{view}/{name}")
            frames = np.zeros((len(block), *array.shape[1:]), dtype=array.dtype)
            for frame, one in zip(frames, block, strict=True):
                snapshot = one.snapshots[view]
                if snapshot is not None:
                    frame[:] = getattr(snapshot, name)
            blocks.append((array, stored, frames))
        end_with(blocks)


def read_last_chunks(group: zarr.Group, *, stored: int) -> dict[str, NDArray[Any]]:
    """The last chunks of a session, as :func:`write_columns` wants them once its columns are no longer packed."""
    start = chunk_start(stored, COLUMN_CHUNK_ROWS)
    return {path: read_rows(array_at(group, path), start, stored) for path in column_paths()}


def column_paths() -> list[str]:
    """Paths, in a session's group, of all arrays but those of the pictures."""
    return [f"attempts/{column.name}" for column in COLUMNS] + [f"{view}/pose_base_tool" for view in VIEWS]


def rechunk_columns(group: zarr.Group, rows: int) -> None:
    """Write every column anew with so many rows in one chunk, unless it has them already."""
    for path in column_paths():
        old = array_at(group, path)
        if old.chunks[0] == rows:
            continue
        values = read_rows(old, 0, old.shape[0])
        folder, _, name = path.rpartition("/")
        parent, attributes, fill = group_at(group, folder), old.attrs.asdict(), old.fill_value
        del parent[name]
        create_array(
            parent, name, dtype=old.dtype.name, row=values.shape[1:], rows=rows, fill=fill, attributes=attributes
        )
        append_rows(array_at(group, path), values)


def chunk_start(row: int, rows: int) -> int:
    """First row of the chunk of ``rows`` rows that holds a row."""
    return row - row % rows


def _pose(snapshot: Snapshot | None) -> NDArray[np.float64]:
    return np.full((4, 4), np.nan) if snapshot is None else snapshot.pose_base_tool.copy()
