"""Schema upgrades: what a newer schema gives to the sessions of an older one, wherever they are kept.

Columns that a schema added hold nothing in older attempts, and what holds nothing does not enter a digest, so attempts
keep theirs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import HeaderError
from handsight.datasets.format.schema import COLUMNS, SCHEMA_VERSION, Column, ColumnWidths
from handsight.datasets.format.sessions import attributes_with_header
from handsight.datasets.format.typed import shown


def current_attributes(attributes: dict[str, Any], schema: int) -> dict[str, Any]:
    """The attributes of a session's group as today's schema has them, from those of an older schema.

    Raises:
        CorruptDataError: They are damaged, which a new digest would hide.
        HeaderError: They were not written by handsight.
    """
    if not isinstance(attributes, dict):
        raise HeaderError(f"the attributes of a session are {shown(attributes)}, expected an object")
    for version in range(schema, SCHEMA_VERSION):
        attributes = _STEPS[version](attributes)
    return attributes


def columns_of(schema: int) -> tuple[Column, ...]:
    """The columns that a schema has."""
    return tuple(column for column in COLUMNS if column.since <= schema)


def columns_since(schema: int) -> tuple[Column, ...]:
    """The columns that came after a schema."""
    return tuple(column for column in COLUMNS if column.since > schema)


def empty_columns(schema: int, rows: int, widths: ColumnWidths) -> dict[str, NDArray[Any]]:
    """What the columns that came after a schema hold for attempts of that schema, by name."""
    return {
        column.name: np.full((rows, *column.shape(widths)), column.fill, column.dtype)
        for column in columns_since(schema)
    }


def _with_conditions(attributes: dict[str, Any]) -> dict[str, Any]:
    """1 to 2: stations name the conditions they vary."""
    header = attributes.get("header")
    station = header.get("station") if isinstance(header, dict) else None
    if not isinstance(header, dict) or not isinstance(station, dict):
        raise HeaderError(f"header.station of a session is {shown(station)}, expected an object")
    return attributes_with_header(attributes, {**header, "station": {**station, "conditions": []}})


_STEPS: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {1: _with_conditions}
"""What brings a session from a schema to the next."""
