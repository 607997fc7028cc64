"""Attempt ids as 24 bytes: the session's ULID (16) and the number in the session (8, big-endian).

What lists attempts outside their session (decisions, folds) stores them in this form.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from ulid import ULID

from handsight.datasets.format.schema import attempt_id, parse_attempt_id

KEY_BYTES = 24
_ULID_BYTES = 16


def keys_from_ids(ids: Sequence[str]) -> NDArray[np.uint8]:
    """The keys of attempts, in order. Shape (N, 24).

    Raises:
        AttemptNotFoundError: A text is no attempt id.
    """
    ulids: dict[str, bytes] = {}
    packed = bytearray()
    for text in ids:
        session, number = parse_attempt_id(text)
        if session not in ulids:
            ulids[session] = ULID.from_str(session).bytes
        packed += ulids[session] + number.to_bytes(KEY_BYTES - _ULID_BYTES, "big")
    return np.frombuffer(bytes(packed), np.uint8).reshape(-1, KEY_BYTES)


def ids_from_keys(keys: NDArray[np.uint8]) -> list[str]:
    """The ids of attempts, in order. ``keys`` has shape (N, 24)."""
    ulids: dict[bytes, str] = {}
    ids = []
    for key in map(bytes, keys):
        packed = key[:_ULID_BYTES]
        if packed not in ulids:
            ulids[packed] = str(ULID(packed))
        ids.append(attempt_id(ulids[packed], int.from_bytes(key[_ULID_BYTES:], "big")))
    return ids
