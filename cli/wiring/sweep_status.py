"""What the cells of a sweep have come to, and how long the rest will take."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

from handsight.cli.output import console
from handsight.cli.tables import print_table
from handsight.cli.wiring.sweeps import duration_text, size_text
from handsight.datasets.errors import counted
from handsight.training.sweep.estimate import estimate
from handsight.training.sweep.folder import SweepFolder
from handsight.training.sweep.place import SweepPlace
from handsight.training.sweep.plan import read_plan

STATES = ("done", "failed", "running", "left")


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepStatus:
    """Where a sweep stands."""

    points: dict[tuple[str, int | None], Counter[str]]
    """For every series and size, how many cells are in each state."""
    failed: dict[str, str]
    """Why, by the name of the cell."""
    workers: int
    seconds_left: float | None
    """With so many workers; None as long as no cell is done."""

    def to_json(self) -> dict[str, Any]:
        """As ``ablate status --json`` prints it."""
        rows = [
            {"series": series, "size": size, **{state: cells[state] for state in STATES}}
            for (series, size), cells in self.points.items()
        ]
        failed = [{"cell": cell, "why": why} for cell, why in self.failed.items()]
        return {"rows": rows, "failed": failed, "seconds_left": self.seconds_left}


def sweep_status(place: SweepPlace, *, workers: int) -> SweepStatus:
    """Where the sweep that is kept there stands."""
    plan, folder = read_plan(place.folder), SweepFolder(place.folder)
    states = {cell: folder.state(cell) for cell in plan.cells()}
    done = folder.results(plan.cells())
    left = [cell for cell, state in states.items() if state in ("left", "running")]
    points: dict[tuple[str, int | None], Counter[str]] = {}
    for cell, state in states.items():
        points.setdefault((cell.series(plan.dataset_names), cell.size), Counter())[state] += 1
    return SweepStatus(
        points=points,
        failed={cell.name: folder.failure(cell) for cell, state in states.items() if state == "failed"},
        workers=workers,
        seconds_left=estimate(plan, left, done, workers=workers, speeds=None).seconds if done else None,
    )


def print_status(status: SweepStatus) -> None:
    """A row for every point of the figure, a line for every failure, and what is left."""
    print_table(
        ("series", "attempts", *STATES),
        [
            (series, size_text(size), *(str(cells[state]) for state in STATES))
            for (series, size), cells in status.points.items()
        ],
    )
    for cell, why in status.failed.items():
        console.print(f"{cell} failed: {why}")
    total = sum(status.points.values(), Counter[str]())
    left = total["left"] + total["running"]
    if left:
        seconds = status.seconds_left
        time_left = "unknown, no cell is done" if seconds is None else f"about {duration_text(seconds)}"
        console.print(
            f"left to do: {left} of {counted(total.total(), 'cell')}, {time_left} on "
            f"{counted(status.workers, 'worker')}"
        )
