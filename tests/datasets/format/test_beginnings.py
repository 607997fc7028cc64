"""Beginnings of ids that tell them apart."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from handsight.datasets.format.beginnings import SHORTEST, telling_length


@given(ids=st.sets(st.text("AB", min_size=20, max_size=20), max_size=30))
def test_beginnings_are_as_many_as_the_ids_and_no_longer_than_needed(ids: set[str]) -> None:
    length = telling_length(ids)
    assert len({one[:length] for one in ids}) == len(ids)
    assert length == SHORTEST or len({one[: length - 1] for one in ids}) < len(ids)
