"""The open loop: a servo method that looks once, takes its first step, and grasps without looking again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypedDict

from handsight.evaluation.comparison import ComparisonRow, comparison_rows
from handsight.evaluation.results import ResultRow, result_rows

if TYPE_CHECKING:
    from handsight.evaluation.trial import Trial


class LoopReport(TypedDict):
    """The open loop, and the closed one against it."""

    rows: list[ResultRow]
    """Of the open loop."""
    comparisons: list[ComparisonRow]
    """Each method against itself with one look, on the same trials."""


def loop_report(
    closed: Mapping[str, Sequence[Trial]], one_look: Mapping[str, Sequence[Trial]], *, methods: Sequence[str]
) -> LoopReport:
    """The open loop, and the closed one against it, of each object set and each method.

    Args:
        closed: Trials of each object set with the loop closed.
        one_look: The same trials with one look.
        methods: Methods that servo.
    """
    report = LoopReport(rows=[], comparisons=[])
    for objects, trials in one_look.items():
        renamed = [replace(trial, method=_name(trial.method)) for trial in trials]
        names = [_name(method) for method in methods]
        report["rows"] += result_rows(renamed, objects=objects, methods=names)
        for method, name in zip(methods, names, strict=True):
            both = [*closed[objects], *renamed]
            report["comparisons"] += comparison_rows(both, objects=objects, methods=(method, name), against=name)
    return report


def _name(method: str) -> str:
    return f"{method}, one look"
