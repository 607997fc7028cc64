"""Tables of cleared tables: objects cleared, grasps for each, success, and one method against another."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypedDict

from handsight.datasets.errors import counted
from handsight.evaluation.clearance import ClearedTable
from handsight.evaluation.comparison import mcnemar_p
from handsight.evaluation.results import wilson_95


class ClearanceRow(TypedDict):
    """What a method made of its tables."""

    method: str
    tables: int
    """Tables that count: those whose scene came to rest."""
    emptied: int
    """Tables with no object left on them."""
    objects: int
    cleared: int
    cleared_share: float
    cleared_ci95: tuple[float, float]
    """Wilson's interval, as if the objects of one table were independent of each other."""
    attempts: int
    """Grasps that count."""
    successes: int
    rate: float
    ci95: tuple[float, float]
    """Wilson's interval for the rate."""
    attempts_per_object: float | None
    """Grasps for each object cleared; None where none was."""
    aborted: int
    """Grasps that do not count."""


class ClearanceComparison(TypedDict):
    """One method against another on the same tables."""

    method: str
    against: str
    pairs: int
    """Tables that count for both."""
    won: int
    """Tables of which only the method cleared the more."""
    lost: int
    p: float
    """Sign test, two-sided; 1 where no table tells them apart."""


def clearance_rows(tables: Iterable[ClearedTable], methods: Sequence[str]) -> list[ClearanceRow]:
    """One row for each method, in the order given."""
    counting = [table for table in tables if table.objects]
    return [_row([table for table in counting if table.method == name], name) for name in methods]


def clearance_comparisons(tables: Iterable[ClearedTable], methods: Sequence[str]) -> list[ClearanceComparison]:
    """Every later method against the first one named."""
    counting = [table for table in tables if table.objects]
    first, *others = methods
    reference = {table.number: table.cleared for table in counting if table.method == first}
    rows = []
    for name in others:
        ours = {table.number: table.cleared for table in counting if table.method == name}
        pairs = [(ours[number], reference[number]) for number in ours.keys() & reference.keys()]
        won, lost = sum(a > b for a, b in pairs), sum(a < b for a, b in pairs)
        rows.append(
            ClearanceComparison(
                method=name, against=first, pairs=len(pairs), won=won, lost=lost, p=mcnemar_p(won, lost)
            )
        )
    return rows


def why_nothing_was_cleared(tables: Sequence[ClearedTable]) -> str | None:
    """What kept every grasp from counting, by the first table's reason; None where one counts."""
    if any(table.attempts for table in tables):
        return None
    return (
        f"no grasp counts in {counted(len(tables), 'table')}, expected at least one: {tables[0].stopped}; mend the "
        "station or the network, and try again"
    )


def _row(tables: list[ClearedTable], method: str) -> ClearanceRow:
    objects, cleared = sum(table.objects for table in tables), sum(table.cleared for table in tables)
    attempts, successes = sum(table.attempts for table in tables), sum(table.successes for table in tables)
    return ClearanceRow(
        method=method,
        tables=len(tables),
        emptied=sum(table.cleared == table.objects for table in tables),
        objects=objects,
        cleared=cleared,
        cleared_share=cleared / objects if objects else 0.0,
        cleared_ci95=wilson_95(cleared, objects),
        attempts=attempts,
        successes=successes,
        rate=successes / attempts if attempts else 0.0,
        ci95=wilson_95(successes, attempts),
        attempts_per_object=attempts / cleared if cleared else None,
        aborted=sum(table.aborted for table in tables),
    )
