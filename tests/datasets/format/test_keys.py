"""Keys name attempts both ways."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from ulid import ULID

from handsight.datasets.format.keys import ids_from_keys, keys_from_ids
from handsight.datasets.format.schema import attempt_id


@given(
    ids=st.lists(
        st.tuples(st.integers(0, 2**128 - 1), st.integers(0, 10**9)).map(
            lambda pair: attempt_id(str(_ulid(pair[0])), pair[1])
        )
    )
)
def test_keys_name_attempts_both_ways(ids: list[str]) -> None:
    keys = keys_from_ids(ids)
    assert keys.dtype == np.dtype(np.uint8)
    assert keys.shape == (len(ids), 24)
    assert ids_from_keys(keys) == ids


def _ulid(value: int) -> ULID:
    return ULID(value.to_bytes(16, "big"))
