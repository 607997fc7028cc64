"""Saved filters as they are stored: ``--where`` expressions with a name, versioned with the dataset.

They are attributes of the group ``/views``: ``{name: {where, author, saved}}``.
"""

from __future__ import annotations

from typing import Any

import zarr

from handsight.datasets.errors import CorruptDataError
from handsight.datasets.format.arrays import group_at

FILTERS_GROUP = "views"
"""Group that holds the saved filters; absent until the first."""


def read_filters(root: zarr.Group) -> dict[str, str]:
    """Expressions of the saved filters by name, sorted."""
    return {name: entry["where"] for name, entry in sorted(filter_entries(root).items())}


def filter_entries(root: zarr.Group) -> dict[str, dict[str, Any]]:
    """What is stored of each saved filter, by name.

    Raises:
        CorruptDataError: Something else is stored there; the message lists every filter of which that is so.
    """
    entries: dict[str, Any] = group_at(root, FILTERS_GROUP).attrs.asdict() if FILTERS_GROUP in root else {}
    strange = [name for name, entry in entries.items() if not _is_filter(entry)]
    if strange:
        raise CorruptDataError(
            f"saved filters {', '.join(map(repr, strange[:5]))} are damaged, expected an expression of each: open a "
            "version from before them, which the dataset's log lists, or restore the dataset from a copy"
        )
    return entries


def _is_filter(entry: object) -> bool:
    return isinstance(entry, dict) and isinstance(entry.get("where"), str)
