"""Saved filters: ``--where`` expressions with a name, kept in the dataset and versioned with it.

They are attributes of the group ``/views``: ``{name: {where, author, saved}}``.
"""

from __future__ import annotations

import zarr

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import RefNameError, UnknownNameError
from handsight.datasets.format.arrays import group_at
from handsight.datasets.format.provenance import utc_now
from handsight.datasets.format.saved_filters import FILTERS_GROUP, filter_entries
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import matches
from handsight.datasets.store.releases import check_name
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.writing.change import change_branch, preview_change


def save_filter(
    repository: GraspRepository,
    name: str,
    where: str,
    *,
    author: str,
    branch: str = DEFAULT_REF,
    replace: bool = False,
    dry_run: bool = False,
) -> int:
    """Keep an expression under a name, in one commit, and return how many attempts it matches now.

    With ``dry_run`` nothing is committed.

    Raises:
        RefNameError: The name is malformed or, without ``replace``, taken by another expression.
        WhereError: The expression is not sound.
        RefNotFoundError: There is no such branch.
    """
    check_name("filter", name)

    def change(dataset: GraspDataset, root: zarr.Group) -> tuple[str | None, int]:
        found = int(matches(dataset.attempts, where).sum())
        entries = filter_entries(root)
        if name in entries and entries[name]["where"] == where:
            return None, found
        if name in entries and not replace:
            raise RefNameError(
                f"there is a filter {name!r} already, {entries[name]['where']!r}: replace it or choose another"
            )
        if dry_run:
            return None, found
        group = group_at(root, FILTERS_GROUP) if FILTERS_GROUP in root else root.create_group(FILTERS_GROUP)
        group.update_attributes({name: {"where": where, "author": author, "saved": utc_now()}})
        return f"save filter {name}: {where}", found

    if dry_run:
        return preview_change(repository, branch, change)
    return change_branch(repository, branch, change).value


def forget_filter(repository: GraspRepository, name: str, *, branch: str = DEFAULT_REF, dry_run: bool = False) -> None:
    """Drop a saved filter, in one commit; earlier versions keep it. With ``dry_run`` nothing is committed.

    Raises:
        UnknownNameError: There is no such filter.
        RefNotFoundError: There is no such branch.
    """

    def change(dataset: GraspDataset, root: zarr.Group) -> tuple[str | None, None]:
        entries = filter_entries(root)
        if name not in entries:
            raise UnknownNameError(
                f"there is no saved filter {name!r} (filters: {', '.join(sorted(entries)) or 'none'})"
            )
        if dry_run:
            return None, None
        group_at(root, FILTERS_GROUP).attrs.put({key: value for key, value in entries.items() if key != name})
        return f"forget filter {name}", None

    if dry_run:
        preview_change(repository, branch, change)
    else:
        change_branch(repository, branch, change)
