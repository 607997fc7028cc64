"""Saved views as they are stored: ``--where`` expressions with a name, versioned with the dataset.

They are attributes of the group ``/views``: ``{name: {where, author, saved}}``.
"""

from __future__ import annotations

from typing import Any

import zarr

from handsight.datasets.format.arrays import group_at

VIEWS_GROUP = "views"
"""Group that holds the saved views; absent until the first."""


def read_views(root: zarr.Group) -> dict[str, str]:
    """Expressions of the saved views by name, sorted."""
    return {name: entry["where"] for name, entry in sorted(view_entries(root).items())}


def view_entries(root: zarr.Group) -> dict[str, dict[str, Any]]:
    """What is stored of each saved view, by name."""
    entries: dict[str, Any] = group_at(root, VIEWS_GROUP).attrs.asdict() if VIEWS_GROUP in root else {}
    return entries
