"""What ``handsight tune`` does: plan, look and tell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from handsight.cli.opening import open_version
from handsight.cli.output import bold, console, progress_bar
from handsight.cli.tables import Column, print_table
from handsight.cli.wiring.sweeps import duration_text, opened, samples_text
from handsight.datasets.errors import counted
from handsight.jobs.engine import Engine
from handsight.training.intervals import MeanOverTrials
from handsight.training.search.plan import SPACE, SearchPlan, settle_search
from handsight.training.search.run import ProposalTask, loss_of, run_search
from handsight.training.search.study import STUDY, check_optuna
from handsight.training.search.table import (
    BEST,
    TABLE,
    ProposalRow,
    best_row,
    proposal_rows,
    row_json,
    write_search,
)
from handsight.training.sweep.estimate import Estimate, estimate, measured_speeds
from handsight.training.sweep.prepare import plan_sweep
from handsight.training.sweep.result import CellResult

_LISTED = 5
"""Proposals on the screen, and the recipe that the search began with."""


def planned(dataset: str, out: Path, *, dry_run: bool, **axes: Any) -> SearchPlan:
    """The plan that the folder has from now on; with ``dry_run`` the one that it would have."""
    check_optuna()
    plan = SearchPlan(sweep=plan_sweep({dataset: open_version(dataset)}, **axes))
    settle_search(out, plan, dry_run=dry_run)
    return plan


def estimated(plan: SearchPlan, out: Path, proposals: int, workers: int) -> Estimate:
    """What is left of a search if nothing is given up, and how long it will take here."""
    rows = proposal_rows(plan, out) if (out / STUDY).is_file() else []
    cells = list(plan.sweep.cells())
    begun = [row for row in rows if row.state in ("running", "left")]
    left = [cell for row in begun for cell in cells[row.trials :]] + cells * max(0, proposals - len(rows))
    speeds = measured_speeds(plan.sweep, opened(plan.sweep).data, workers)
    return estimate(plan.sweep, left, {}, workers=workers, speeds=speeds)


def run(plan: SearchPlan, out: Path, *, proposals: int, workers: int, engine: Engine) -> list[ProposalRow]:
    """Judge proposals behind a progress bar, and write what was found; returns all proposals, the best first."""
    data = opened(plan.sweep).data  # inputs are made once, here, and not by every worker
    trials = plan.sweep.trials
    with progress_bar("trials", proposals * trials) as bar:
        # Trials of proposals that are over count as done, whether they were trained or not.
        rows = proposal_rows(plan, out)
        bar.reached(sum(trials if row.state in ("done", "pruned", "failed") else row.trials for row in rows))

        def show(task: ProposalTask, result: CellResult | None) -> None:
            said = "failed" if result is None else f"{loss_of(result):.3f}"
            bar.advance(f"proposal {task.proposal}, trial {task.cell.trial}: {said}")

        run_search(plan, out, proposals=proposals, workers=workers, engine=engine, data=data, on_cell=show)
    rows = proposal_rows(plan, out)
    write_search(plan, out, rows)
    return rows


def found(rows: Sequence[ProposalRow], out: Path) -> dict[str, Any]:
    """What ``--json`` prints."""
    best = best_row(rows)
    return {
        "out": str(out),
        "states": _states(rows),
        "best": None if best is None else row_json(best),
        "proposals": [row_json(row) for row in rows],
    }


def print_found(rows: Sequence[ProposalRow], out: Path) -> None:
    """The best proposals and the recipe that the search began with."""
    done = [row for row in rows if row.state == "done"]
    listed = done[:_LISTED] + [row for row in done[_LISTED:] if row.number == 0]
    if listed:
        interval = Column(heading="95 % interval", rank=1)
        values = [Column(heading=name, rank=2) for name in SPACE]
        lines = [
            (
                f"{row.number} (usual)" if row.number == 0 else str(row.number),
                _number(row.loss),
                "-" if row.difference is None else f"{row.difference.mean:+.4f}",
                _interval(row.difference),
                _number(row.accuracy),
                *(f"{row.values[name]:.3g}" for name in SPACE),
            )
            for row in listed
        ]
        print_table(("proposal", "loss", "less usual", interval, "accuracy", *values), lines)
        console.print()
    for row in rows:
        if row.state == "failed":
            console.print(f"proposal {row.number} failed: {row.why}")
    states = _states(rows)
    rest = "".join(f", {count} {name}" for name, count in states.items() if count and name != "done")
    console.print(bold(out), f": {states['done']} of {counted(len(rows), 'proposal')} done{rest}")
    best = best_row(rows)
    if best is None:
        return
    if best.number:
        console.print(
            f"proposal {best.number} is the best of {states['done']} on the same trials, so it is not as good as it "
            "looks: compare it with the usual recipe on other trials (--seed) before it is trusted"
        )
    else:
        console.print("nothing was better than the usual recipe")
    console.print("recipe: ", bold(out / BEST), "; all proposals: ", bold(out / TABLE))


def print_estimate(plan: SearchPlan, left: Estimate, workers: int) -> None:
    """What is left to do, and how long it takes."""
    sweep, size = plan.sweep, plan.sweep.sizes[0]
    learnt = "all attempts" if size is None else counted(size, "attempt")
    console.print(f"{sweep.channels[0]}, {learnt}, {counted(sweep.trials, 'trial')} for each proposal")
    console.print(f"looked for: {', '.join(SPACE)}")
    console.print(
        f"{counted(left.cells, 'training')} left if no proposal is given up, {samples_text(left.samples)} "
        f"at {left.samples_per_s:,.0f}/s with a worker: about {duration_text(left.seconds)} on "
        f"{counted(workers, 'worker')}"
    )


def _states(rows: Sequence[ProposalRow]) -> dict[str, int]:
    states = [row.state for row in rows]
    return {name: states.count(name) for name in ("done", "pruned", "failed", "running", "left")}


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"


def _interval(mean: MeanOverTrials | None) -> str:
    return "-" if mean is None or mean.low is None else f"{mean.low:+.4f} - {mean.high:+.4f}"
