"""Which attempts to look at, in what order, and what of them, for versions of any size.

The end of the table is read alone. An expression or an order has to see every attempt, yet only in the columns that it
names; what is shown is then read for the attempts that are shown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from handsight.datasets.errors import ListingError, WhereError
from handsight.datasets.format.saved_filters import read_filters
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import check_where, expressions, matches
from handsight.datasets.reading.where_kinds import nearest
from handsight.datasets.reading.where_tree import columns_in


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """What is asked for. Without ``sort`` attempts come in the order of sessions and numbers, the oldest first."""

    where: str = ""
    """An expression that holds for the attempts wanted; empty for none."""
    filter: str = ""
    """Name of a saved filter; empty for none. With ``where``, both must hold."""
    sort: str = ""
    """Column to order by, the smallest first and what is missing last; empty for none. Equals keep their order."""
    reverse: bool = False
    """The largest first or, without ``sort``, the newest."""
    columns: tuple[str, ...] | None = None
    """Columns of the attempts table, in the order wanted; None for all. The id is there in any case."""
    limit: int = 0
    """At most so many: the first ones with ``sort``, else the newest. 0 for all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Listed:
    """What was found."""

    rows: pd.DataFrame
    """The attempts to show, indexed by id."""
    matched: int
    """How many match; ``rows`` has fewer where there is a limit."""
    total: int
    """How many the version holds."""


def list_attempts(dataset: GraspDataset, listing: Listing) -> Listed:
    """Find the attempts asked for. Reads no pictures.

    Raises:
        ListingError: There is no such column or filter, an expression is not sound, or the limit is negative; the
            message lists every fault.
        WhereError: An expression yields no truth values.
    """
    conditions = _checked(dataset, listing)
    total = sum(session.attempts for session in dataset.sessions)
    columns = None if listing.columns is None else _without_id(listing.columns)
    if not conditions and not listing.sort:
        rows = dataset.tail(listing.limit or total, columns)
        return Listed(rows=rows[::-1] if listing.reverse else rows, matched=total, total=total)
    needed = [name for where in conditions for name in columns_in(where)]
    table = dataset.table(*_without_id([*needed, *_sort_column(listing)]))
    for where in conditions:
        table = table[matches(table, where)]
    ids = _in_order(table, listing)
    return Listed(rows=dataset.rows(ids, columns).loc[ids], matched=len(table), total=total)


def _checked(dataset: GraspDataset, listing: Listing) -> list[str]:
    """The expressions that must hold, once nothing is wrong with the listing."""
    none = dataset.tail(0)
    known = [str(none.index.name), *map(str, none.columns)]
    faults = [] if listing.limit >= 0 else [f"limit is {listing.limit}, expected 0 for all or a number of attempts"]
    faults += _unknown_columns([*_sort_column(listing), *(listing.columns or ())], known)
    conditions: list[str] = []
    try:
        conditions = expressions(listing.where, listing.filter, read_filters(dataset.root))
    except WhereError as error:
        faults.append(str(error))
    # A filter that is missing does not keep the expression beside it from being checked.
    for where in conditions or ([listing.where] if listing.where else []):
        try:
            check_where(none, where)
        except WhereError as error:
            faults.append(str(error))
    if faults:
        raise ListingError("; ".join(faults))
    return conditions


def _unknown_columns(names: Sequence[str], known: Sequence[str]) -> list[str]:
    """A fault for each name that is no column; those without a near miss share one, which lists what there is."""
    ends: dict[str, list[str]] = {}
    for name in dict.fromkeys(names):
        if name not in known:
            ends.setdefault(nearest(name, known), []).append(repr(name))
    return [f"there is no column {' or '.join(unknown)}{end}" for end, unknown in ends.items()]


def _sort_column(listing: Listing) -> list[str]:
    return [listing.sort] if listing.sort else []


def _without_id(names: Sequence[str]) -> tuple[str, ...]:
    """The names, each once, but that of the table's index."""
    return tuple(name for name in dict.fromkeys(names) if name != "attempt")


def _in_order(table: pd.DataFrame, listing: Listing) -> list[str]:
    """Ids of the attempts to show, in the order asked for."""
    count = listing.limit or len(table)
    if listing.sort:
        ordered = table.sort_values(listing.sort, ascending=not listing.reverse, kind="stable", na_position="last")
        return ordered.index[:count].tolist()
    ids = table.index[len(table) - min(count, len(table)) :].tolist()
    return ids[::-1] if listing.reverse else ids
