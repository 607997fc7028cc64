"""Batches of attempts on their way into the arrays of a session."""

from __future__ import annotations

from collections.abc import Coroutine, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from handsight.datasets.errors import RecordError
from handsight.datasets.format.arrays import (
    Arrays,
    Layouts,
    append_rows,
    array_at,
    group_at,
    read_all,
    read_rows,
    truncate_and_append,
    truncate_and_append_chunks,
)
from handsight.datasets.format.digest import attempt_digest
from handsight.datasets.format.frames import EncodedFrames, frame_paths
from handsight.datasets.format.rows import frame_of, to_row
from handsight.datasets.format.schema import (
    COLUMN_CHUNK_ROWS,
    COLUMNS,
    SESSION_AXES,
    VIEWPOINTS,
    Viewpoint,
    blank_session,
    column_widths,
    create_array,
)
from handsight.datasets.format.validation import attempt_faults
from handsight.datasets.records import GraspAttempt, RgbdFrame, SessionHeader

Columns = dict[str, NDArray[Any]]
"""The values of one attempt by the path of their array in the session's group: everything but the frames."""

Write = Coroutine[Any, Any, None]
"""One of the writes that :func:`~handsight.datasets.format.arrays.run_concurrently` does."""

LastChunks = Mapping[str, NDArray[Any]]
"""The rows of the last, unfinished chunk of every column, by its path in the session's group."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreparedAttempt:
    """A valid attempt, ready to be written."""

    columns: Columns
    frames: dict[Viewpoint, RgbdFrame | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class EncodedAttempt:
    """A valid attempt whose pictures are encoded as the session will store them."""

    columns: Columns
    frames: EncodedFrames


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
    row = to_row(attempt, widths=column_widths(header))
    row["digest"] = np.frombuffer(attempt_digest(attempt, header.station, row=row), dtype=np.uint8)
    frames = {viewpoint: frame_of(attempt, viewpoint) for viewpoint in VIEWPOINTS}
    columns = {f"attempts/{name}": value for name, value in row.items()}
    poses = {f"{viewpoint}/pose_base_tool": _pose(frame) for viewpoint, frame in frames.items()}
    return PreparedAttempt(columns={**columns, **poses}, frames=frames)


def new_layouts(header: SessionHeader, *, column_rows: int = COLUMN_CHUNK_ROWS) -> Layouts:
    """The arrays of a session that begins, as they are to be created."""
    layouts = blank_session(header, column_rows=column_rows).layouts
    return {path: layouts[path] for path in (*column_paths(), *frame_paths())}


def session_arrays(group: zarr.Group) -> Arrays:
    """All arrays of a session.

    Raises:
        CorruptDataError: One is missing or damaged.
    """
    return {path: array_at(group, path) for path in (*column_paths(), *frame_paths())}


def column_writes(
    arrays: Arrays, rows: Sequence[Columns], *, stored: int, last_chunks: LastChunks
) -> tuple[list[Write], LastChunks]:
    """What appends rows to every column of a session that holds ``stored``; and the new last chunks."""
    stop = stored + len(rows)
    writes, finished = [], {}
    for path in column_paths():
        array = arrays[path]
        start = chunk_start(stored, array.chunks[0])
        # Whole chunks from memory: a partial write would first read the last chunk back, at twice the time.
        batch = [row[path] for row in rows]
        whole = np.concatenate([last_chunks[path], batch]) if stored > start else np.stack(batch)
        writes.append(truncate_and_append(array, start, whole))
        finished[path] = whole[chunk_start(stop, array.chunks[0]) - start :]
    return writes, finished


def frame_writes(arrays: Arrays, frames: Sequence[EncodedFrames], *, stored: int) -> list[Write]:
    """What appends the pictures of attempts, which :class:`FrameEncoder` has encoded for these arrays."""
    return [
        truncate_and_append_chunks(arrays[path], stored, [one.get(path) for one in frames]) for path in frame_paths()
    ]


def read_last_chunks(arrays: Arrays, *, stored: int) -> LastChunks:
    """The last chunks of a session, as :func:`write_columns` wants them once its columns are no longer packed."""
    start = chunk_start(stored, COLUMN_CHUNK_ROWS)
    return {path: read_rows(arrays[path], start, stored) for path in column_paths()}


def column_paths() -> list[str]:
    """Paths, in a session's group, of all arrays but those of the pictures."""
    return [f"attempts/{column.name}" for column in COLUMNS] + [
        f"{viewpoint}/pose_base_tool" for viewpoint in VIEWPOINTS
    ]


def rechunk_columns(group: zarr.Group, rows: int) -> None:
    """Write every column anew with so many rows in one chunk, unless it has them already."""
    for path in column_paths():
        old = array_at(group, path)
        if old.chunks[0] == rows:
            continue
        values = read_all(old)
        folder, _, name = path.rpartition("/")
        parent, attributes, fill = group_at(group, folder), old.attrs.asdict(), old.fill_value
        del parent[name]
        create_array(
            parent,
            name,
            dtype=old.dtype.name,
            row=values.shape[1:],
            axes=SESSION_AXES[path],
            rows=rows,
            fill=fill,
            attributes=attributes,
        )
        append_rows(array_at(group, path), values)


def chunk_start(row: int, rows: int) -> int:
    """First row of the chunk of ``rows`` rows that holds a row."""
    return row - row % rows


def _pose(frame: RgbdFrame | None) -> NDArray[np.float64]:
    return np.full((4, 4), np.nan) if frame is None else frame.pose_base_tool.copy()
