"""Tables of cleared tables, counted by hand."""

from __future__ import annotations

from dataclasses import replace

from handsight.evaluation.clearance import ClearedTable
from handsight.evaluation.clearance_rows import clearance_comparisons, clearance_rows, why_nothing_was_cleared
from handsight.evaluation.results import wilson_95

ALL = ClearedTable(number=0, method="global", objects=5, cleared=5, attempts=6, successes=5, aborted=0, stopped="")
HALF = replace(
    ALL, number=1, cleared=2, attempts=5, successes=3, aborted=1, stopped="3 grasps in a row brought nothing"
)
NEVER = ClearedTable(
    number=2, method="global", objects=0, cleared=0, attempts=0, successes=0, aborted=1, stopped="settle: rolling"
)


def test_a_row_counts_objects_grasps_and_tables() -> None:
    (row,) = clearance_rows([ALL, HALF, NEVER], ["global"])
    assert (row["tables"], row["emptied"], row["objects"], row["cleared"]) == (2, 1, 10, 7)
    assert (row["attempts"], row["successes"], row["aborted"]) == (11, 8, 1)
    assert (row["cleared_share"], row["cleared_ci95"]) == (0.7, wilson_95(7, 10))
    assert (row["rate"], row["ci95"]) == (8 / 11, wilson_95(8, 11))
    assert row["attempts_per_object"] == 11 / 7


def test_nothing_cleared_has_no_grasps_for_each() -> None:
    (row,) = clearance_rows([replace(HALF, cleared=0)], ["global"])
    assert row["attempts_per_object"] is None


def test_methods_are_compared_on_the_tables_that_count_for_both() -> None:
    others = [replace(table, method="random", cleared=0) for table in (ALL, NEVER)]
    (row,) = clearance_comparisons([ALL, HALF, NEVER, *others], ["global", "random"])
    assert (row["method"], row["against"], row["pairs"], row["won"], row["lost"]) == ("random", "global", 1, 0, 1)
    assert row["p"] == 1.0


def test_why_nothing_was_cleared_is_told_only_where_no_grasp_counts() -> None:
    assert why_nothing_was_cleared([NEVER, HALF]) is None
    assert "settle: rolling" in (why_nothing_was_cleared([NEVER]) or "")
