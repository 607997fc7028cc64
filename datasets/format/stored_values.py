"""Stored columns as they are read back: what another program wrote into them with sound checksums is found here.

No checksum of the store sees a value that handsight never writes. Without this look it would end in an error about an
index, or worse, as another label or another object.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from handsight.datasets.errors import CorruptDataError
from handsight.datasets.format.arrays import read_range
from handsight.datasets.format.schema import COLUMNS, ColumnWidths, attempt_id, column_widths
from handsight.datasets.format.sessions import SessionInfo
from handsight.datasets.records import Outcome

_COLUMNS = {column.name: column for column in COLUMNS}
_REMEDY = "verify finds all such attempts, and repair replaces them on a new branch"

Bounds = tuple[int, int]
_BOUNDS: Mapping[str, Callable[[SessionInfo, ColumnWidths], Bounds]] = {
    "outcome": lambda session, widths: (0, len(Outcome) - 1),
    "object_count": lambda session, widths: (-1, widths.objects),
    "target": lambda session, widths: (-1, widths.objects - 1),
    "catalogue_index": lambda session, widths: (-1, len(session.header.station.objects) - 1),
    "truth_held": lambda session, widths: (-1, 1),
    "started_elapsed_ns": lambda session, widths: (0, np.iinfo(np.int64).max),
}
"""The least and the greatest whole number that a column can hold."""


def read_column(
    array: zarr.Array[Any], name: str, session: SessionInfo, start: int = 0, stop: int | None = None
) -> NDArray[Any]:
    """Some rows of a column of a session, or all of them, each of which an attempt can have.

    Raises:
        CorruptDataError: Its bytes are damaged, or it has another type or length than the session, or values that no
            attempt can have; the message names the attempt.
    """
    column, widths = _COLUMNS[name], column_widths(session.header)
    found, expected = (array.dtype, array.shape), (np.dtype(column.dtype), (session.attempts, *column.shape(widths)))
    if found != expected:
        raise CorruptDataError(
            f"{array.path} is {found[0]} {found[1]}, expected {expected[0]} {expected[1]}: {_REMEDY}"
        )
    values = read_range(array, start, session.attempts if stop is None else stop)
    strange = _strange(name, values, session, widths, start)
    if strange is not None:
        row, expected_value = strange
        raise impossible(session.ulid, start + row, name, values[row], expected_value)
    return values


def impossible(ulid: str, number: int, column: str, value: Any, expected: str) -> CorruptDataError:
    """The error for a value that no attempt can have."""
    shown = np.array2string(np.asarray(value), threshold=8, edgeitems=2, separator=", ").replace("\n", " ")
    return CorruptDataError(f"attempt {attempt_id(ulid, number)}: {column} is {shown}, expected {expected}; {_REMEDY}")


def _strange(
    name: str, values: NDArray[Any], session: SessionInfo, widths: ColumnWidths, start: int
) -> tuple[int, str] | None:
    """The first row that no attempt can have, and what was expected there."""
    if name == "failure":
        return _no_text(values)
    if name == "number":
        wrong, expected = values != np.arange(start, start + len(values)), "its place in the session"
    elif name in _BOUNDS:
        least, most = _BOUNDS[name](session, widths)
        if not values.size or (values.min() >= least and values.max() <= most):
            return None  # A mask of a million rows costs more than their reading.
        wrong, expected = (values < least) | (values > most), f"{least} to {most}"
    else:
        return None
    rows = np.flatnonzero(wrong.any(axis=tuple(range(1, wrong.ndim))))
    return (int(rows[0]), expected) if len(rows) else None


def _no_text(values: NDArray[np.uint8]) -> tuple[int, str] | None:
    for row in np.flatnonzero(values[:, 0]):
        try:
            values[row].tobytes().decode()
        except UnicodeDecodeError:
            return int(row), "text in UTF-8"
    return None
