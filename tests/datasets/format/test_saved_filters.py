"""Saved filters that some other program wrote are found when they are read."""

from __future__ import annotations

from typing import Any

import pytest
import zarr
from zarr.storage import MemoryStore

from handsight.datasets import CorruptDataError
from handsight.datasets.format.saved_filters import FILTERS_GROUP, read_filters


@pytest.mark.parametrize("entry", [None, "success", {}, {"where": 5}, {"author": "jo"}, []])
def test_an_entry_that_is_no_expression_is_named(entry: Any) -> None:
    root = zarr.create_group(MemoryStore())
    sound = {"where": "success", "author": "jo", "saved": "2026-01-31"}
    root.create_group(FILTERS_GROUP, attributes={"good": sound, "slips": entry})
    with pytest.raises(CorruptDataError, match="saved filters 'slips' are damaged, expected an expression"):
        read_filters(root)
    root[FILTERS_GROUP].attrs.put({"good": sound})
    assert read_filters(root) == {"good": "success"}
