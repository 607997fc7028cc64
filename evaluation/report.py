"""Everything that is told of an evaluation, as ``evaluate --json`` prints it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict

from handsight.evaluation.calibration import CalibrationRow, calibration_rows
from handsight.evaluation.causes import CausesRow, causes_rows
from handsight.evaluation.comparison import ComparisonRow, comparison_rows
from handsight.evaluation.durations import DurationRow, duration_rows
from handsight.evaluation.results import ResultRow, result_rows, why_nothing_counts
from handsight.evaluation.trial import Trial


class Report(TypedDict):
    """Tables of an evaluation; the rows of each go from object set to object set, then from method to method."""

    rows: list[ResultRow]
    comparisons: list[ComparisonRow]
    durations: list[DurationRow]
    calibration: list[CalibrationRow]
    causes: list[CausesRow]
    fault: str | None
    """Why nothing was evaluated, where no trial counts."""


def evaluation_report(
    trials: Mapping[str, Sequence[Trial]],
    *,
    methods: Sequence[str],
    closed_width_m: float,
    threshold: float,
    against: str | None = None,
) -> Report:
    """All tables of the trials.

    Args:
        trials: Of each object set.
        methods: What was evaluated, in the order of the tables.
        closed_width_m: Openings of the gripper at or below this count as closed [m].
        threshold: Predicted success above which a grasp is executed at once.
        against: Reference of the comparisons; the best on each object set unless given.
    """
    report = Report(rows=[], comparisons=[], durations=[], calibration=[], causes=[], fault=None)
    for objects, some in trials.items():
        report["rows"] += result_rows(some, objects=objects, methods=methods)
        report["comparisons"] += comparison_rows(some, objects=objects, methods=methods, against=against)
        report["durations"] += duration_rows(some, objects=objects, methods=methods)
        report["calibration"] += calibration_rows(some, objects=objects, methods=methods)
        report["causes"] += causes_rows(
            some, objects=objects, methods=methods, closed_width_m=closed_width_m, threshold=threshold
        )
    report["fault"] = why_nothing_counts(trial for some in trials.values() for trial in some)
    return report
