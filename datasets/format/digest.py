"""What makes two attempts, or two datasets, the same.

The digest of an attempt is a SHA-256 over everything recorded about it except what merely identifies it: its id (the
session's ULID and its number) and the wall clock. Objects enter by name, because an index means nothing outside
its session, and the station enters as far as it is needed to interpret the record. Seed, configuration and code
version are provenance, not content.

The digest of a dataset is a SHA-256 over the sorted digests of its attempts, so it depends on neither commits nor
the number or order of sessions.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.format.header import canonical_json, station_to_json
from handsight.datasets.format.rows import Row, frame_of, to_row
from handsight.datasets.format.schema import COLUMNS, VIEWPOINTS, ColumnWidths
from handsight.datasets.records import GraspAttempt, SceneObjects, StationSpec

_ATTEMPT_PREFIX = b"handsight attempt 1\n"
_DATASET_PREFIX = b"handsight dataset 1\n"


def attempt_digest(attempt: GraspAttempt, station: StationSpec, *, row: Row | None = None) -> bytes:
    """The content of one attempt, as 32 bytes. The attempt must be valid for the station.

    Args:
        attempt: What is digested.
        station: The station spec of its session.
        row: Its columns, if they have been made already; the width of the session's does not matter.
    """
    digest = hashlib.sha256(_ATTEMPT_PREFIX)
    instruments = station_to_json(station)
    del instruments["objects"]
    if not station.conditions:
        del instruments["conditions"]  # Schema 1 knew of none, and its digests stay what they are.
    _feed_text(digest, "station", canonical_json(instruments))
    _feed_text(digest, "objects", canonical_json(object_names(attempt.scene, station)))
    widths = _exact_widths(attempt.scene)
    row = to_row(attempt, widths=widths) if row is None else row
    for column in COLUMNS:
        if column.digested:
            used: tuple[Any, ...] = (*map(slice, column.shape(widths)), ...)
            value = row[column.name][used]
            if column.since == 1 or not np.isnan(value).all():
                _feed_array(digest, column.name, value)
    for viewpoint in VIEWPOINTS:
        frame = frame_of(attempt, viewpoint)
        if frame is not None:
            _feed_array(digest, f"{viewpoint}/rgb", frame.rgb)
            _feed_array(digest, f"{viewpoint}/depth", frame.depth)
            _feed_array(digest, f"{viewpoint}/pose_base_tool", frame.pose_base_tool)
    return digest.digest()


def dataset_digest(attempt_digests: Iterable[bytes]) -> str:
    """The content of a dataset, as 64 hexadecimal digits, from the digests of its attempts in any order.

    The bytes may come in any portions: one digest each, or those of a session at once.
    """
    rows = np.frombuffer(b"".join(attempt_digests), dtype=f"S{hashlib.sha256().digest_size}")
    digest = hashlib.sha256(_DATASET_PREFIX)
    digest.update(_in_byte_order(rows).data)
    return digest.hexdigest()


def _in_byte_order(rows: NDArray[np.bytes_]) -> NDArray[np.bytes_]:
    """Digests sorted by their bytes: by the first eight as one number, which takes a third of the time.

    All are of one length, so the padding that NumPy's byte strings ignore does not affect their order.
    """
    heads = rows.view(">u8")[:: rows.itemsize // 8].astype(np.uint64)
    order = np.argsort(heads)
    ordered = heads[order]
    if (ordered[1:] == ordered[:-1]).any():
        return np.sort(rows)
    return rows[order]


def object_names(scene: SceneObjects | None, station: StationSpec) -> tuple[str, ...]:
    """The objects of a scene by name, in the scene's order."""
    return () if scene is None else tuple(station.objects[index] for index in scene.catalogue_index)


def _exact_widths(scene: SceneObjects | None) -> ColumnWidths:
    """As wide as the scene, so that the width of the session's columns does not matter."""
    if scene is None:
        return ColumnWidths(objects=0, conditions=0)
    return ColumnWidths(objects=len(scene.catalogue_index), conditions=len(scene.conditions))


def _feed_text(digest: hashlib._Hash, name: str, text: str) -> None:
    encoded = text.encode()
    digest.update(f"{name} {len(encoded)}\n".encode())
    digest.update(encoded)


def _feed_array(digest: hashlib._Hash, name: str, array: NDArray[Any]) -> None:
    if np.issubdtype(array.dtype, np.floating):
        # One bit pattern for each value: a chunk of fill values is not stored, so -0.0 and odd NaNs may not survive.
        array = np.where(np.isnan(array), np.array(np.nan, array.dtype), array + array.dtype.type(0))
    little = array.astype(array.dtype.newbyteorder("<"), copy=False)
    digest.update(f"{name} {little.dtype.str} {little.shape}\n".encode())
    digest.update(np.ascontiguousarray(little).data)
