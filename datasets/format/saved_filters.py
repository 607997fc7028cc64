"""Saved filters as they are stored: ``--where`` expressions with a name, versioned with the dataset.

They are attributes of the group ``/views``: ``{name: {where, author, saved}}``.
"""

from __future__ import annotations

from typing import Any

import zarr

from handsight.datasets.format.arrays import group_at

FILTERS_GROUP = "views"
"""Group that holds the saved filters; absent until the first."""


def read_filters(root: zarr.Group) -> dict[str, str]:
    """Expressions of the saved filters by name, sorted."""
    return {name: entry["where"] for name, entry in sorted(filter_entries(root).items())}


def filter_entries(root: zarr.Group) -> dict[str, dict[str, Any]]:
    """What is stored of each saved filter, by name."""
    entries: dict[str, Any] = group_at(root, FILTERS_GROUP).attrs.asdict() if FILTERS_GROUP in root else {}
    return entries
