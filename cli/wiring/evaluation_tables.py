"""How the tables of an evaluation look on the screen."""

from __future__ import annotations

from collections.abc import Sequence

from handsight.cli.output import console
from handsight.cli.tables import Column, print_table
from handsight.datasets.errors import counted
from handsight.evaluation.calibration import CalibrationRow
from handsight.evaluation.causes import CausesRow
from handsight.evaluation.comparison import ComparisonRow
from handsight.evaluation.one_look import LoopReport
from handsight.evaluation.results import ResultRow


def print_results(rows: Sequence[ResultRow]) -> None:
    """The table of results."""
    cells = [
        (
            row["method"],
            row["objects"],
            f"{row['successes']}/{row['trials']}",
            f"{row['rate']:.1%}" if row["trials"] else "-",
            interval(row["ci95"]) if row["trials"] else "-",
            str(row["aborted"]),
            "-" if row["mean_steps"] is None else f"{row['mean_steps']:.1f}",
            "-" if row["step_ms"] is None else f"{row['step_ms']:.1f}",
        )
        for row in rows
    ]
    columns = (
        "method",
        Column(heading="objects", rank=4 if len({row["objects"] for row in rows}) == 1 else 0),
        "grasped",
        "success",
        Column(heading="95 % interval", rank=1),
        Column(heading="aborted", rank=2),
        Column(heading="moves", rank=3),
        Column(heading="ms/step", rank=5),
    )
    print_table(columns, cells)
    console.print()


def print_comparisons(rows: Sequence[ComparisonRow]) -> None:
    """The methods against their reference, if there is more than one method."""
    if not rows:
        return
    console.print("paired with the reference; p of McNemar's exact test, two-sided")
    cells = [
        (
            row["method"],
            row["against"],
            row["objects"],
            str(row["pairs"]),
            str(row["won"]),
            str(row["lost"]),
            f"{row['p']:.2g}",
        )
        for row in rows
    ]
    print_table(("method", "against", Column(heading="objects", rank=1), "pairs", "won", "lost", "p"), cells)
    console.print()


def print_one_look(report: LoopReport, disturbance: str) -> None:
    """Methods with one look, and with all of theirs against that."""
    console.print(f"with one look, disturbed by {disturbance}")
    print_results(report["rows"])
    print_comparisons(report["comparisons"])


def print_calibration(rows: Sequence[CalibrationRow]) -> None:
    """Scores at the grasp against what came of them."""
    console.print("success by the score at the grasp")
    cells = [
        (
            row["method"],
            row["objects"],
            f"{row['low']:.2f} - {row['high']:.2f}",
            f"{row['mean_score']:.3f}",
            f"{row['successes']}/{row['trials']}",
            f"{row['rate']:.1%}",
            interval(row["ci95"]),
        )
        for row in rows
    ]
    columns = ("method", Column(heading="objects", rank=1), "score", "mean", "grasped", "success", "95 % interval")
    print_table(columns, cells)
    console.print()


def print_causes(rows: Sequence[CausesRow]) -> None:
    """Failures by cause, for each method those that occur."""
    console.print("failures by cause")
    for row in rows:
        unsure = f", {row['unsure']} below the threshold" if row["unsure"] else ""
        failed = f"{counted(row['failures'], 'failure')} in {counted(row['trials'], 'trial')}"
        console.print(f"  {row['method']} on {row['objects']}: {failed}{unsure}")
        for name, count in row["causes"].items():
            if count:
                console.print(f"    {count:>4}  {name}")
        for what, phases in (
            ("landed with", row["landed_with"]),
            ("blocked in", row["blocked_in"]),
            ("lost in", row["lost_in"]),
            ("not counted, ended by", row["aborted_in"]),
        ):
            if phases:
                console.print(f"          {what}: {', '.join(f'{name} {count}' for name, count in phases.items())}")
        if row["pushed_away"]:
            console.print(f"          closed on nothing, the object pushed away: {row['pushed_away']}")
    console.print()


def interval(ends: tuple[float, float]) -> str:
    """The ends of an interval of shares, in per cent."""
    return f"{ends[0]:.1%} - {ends[1]:.1%}"
