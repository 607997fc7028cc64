"""What ``handsight ablate`` and ``handsight crossval`` do: plan, train and tell."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from handsight.cli.opening import open_version
from handsight.cli.output import console, progress_bar
from handsight.cli.tables import Column, print_table
from handsight.cli.wiring.sweep_readme import readme
from handsight.datasets.atomic import write_text
from handsight.datasets.errors import counted
from handsight.jobs.engine import Engine
from handsight.training.intervals import MeanOverTrials
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.estimate import Estimate, estimate, measured_speeds
from handsight.training.sweep.folder import SweepFolder
from handsight.training.sweep.place import SweepPlace
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.prepare import plan_sweep, settle
from handsight.training.sweep.result import CellResult
from handsight.training.sweep.run import SweepReport, chosen_by, run_sweep
from handsight.training.sweep.table import object_rows, sweep_differences, sweep_rows
from handsight.training.sweep.work import SweepContext, materialized
from handsight.viz.figures.ablation import ablation_figure

FIGURE = "figure7"
_WORST = 8
"""Objects that are listed on the screen."""


def planned(
    datasets: Sequence[str], out: Path, *, only: Sequence[str], allowed: Sequence[str], dry_run: bool, **axes: Any
) -> SweepPlan:
    """The plan that the folder has from now on; with ``dry_run`` the one that it would have."""
    plan = plan_sweep({address: open_version(address) for address in datasets}, **axes)
    chosen_by(only, plan)  # refused before the folder is made
    return settle(out, plan, allowed=allowed, dry_run=dry_run)


def opened(plan: SweepPlan) -> SweepContext:
    """The data of a plan, warped behind a progress bar where that is still to be done."""
    data = []
    for dataset in plan.datasets:
        with progress_bar("warp", dataset.attempts) as bar:
            data.append(materialized(dataset, plan, bar.advance))
    return SweepContext(plan, data)


def estimated(plan: SweepPlan, folder: SweepFolder, chosen: Callable[[Cell], bool], workers: int) -> Estimate:
    """What is left of the chosen cells, and how long it will take here."""
    cells = [cell for cell in plan.cells() if chosen(cell)]
    done = folder.results(cells)
    left = [cell for cell in cells if cell not in done]
    speeds = None if done else measured_speeds(plan, opened(plan).data, workers)
    return estimate(plan, left, done, workers=workers, speeds=speeds)


def run(
    plan: SweepPlan,
    place: SweepPlace,
    *,
    workers: int,
    engine: Engine,
    only: Sequence[str] = (),
    retry_failed: bool = False,
    restart_failed: bool = False,
) -> SweepReport:
    """Train what is left of a sweep behind a progress bar, and keep it where the sweep is kept."""
    folder, chosen = SweepFolder(place.folder), chosen_by(only, plan)
    place.keep_plan()
    if retry_failed or restart_failed:
        for cell in filter(chosen, plan.cells()):
            if folder.state(cell) == "failed":
                folder.forget_failure(cell, restart=restart_failed)
                place.keep_cell(cell)
    data = opened(plan).data  # inputs are made once, here, and not by every worker
    cells = [cell for cell in plan.cells() if chosen(cell)]
    ended = sum(folder.state(cell) in ("done", "failed") for cell in cells)
    with progress_bar("cells", len(cells)) as bar:
        bar.reached(ended)

        def show(cell: Cell, result: CellResult | None) -> None:
            place.keep_cell(cell)
            accuracy = None if result is None else result.tested.accuracy
            bar.advance(f"{cell.name} failed" if accuracy is None else f"{cell.name} {accuracy:.3f}")

        return run_sweep(plan, folder, workers=workers, engine=engine, data=data, chosen=chosen, on_cell=show)


def write_tables(plan: SweepPlan, place: SweepPlace) -> dict[str, Any]:
    """Write what a sweep has found so far, and keep it with the sweep; returns what ``--json`` prints."""
    out = place.folder
    folder = SweepFolder(out)
    results = folder.results(plan.cells())
    named = plan.dataset_names
    rows, differences = sweep_rows(results, named), sweep_differences(results, named)
    objects = object_rows(results, named)
    state_of = {cell: folder.state(cell) for cell in plan.cells()}
    counts = {state: list(state_of.values()).count(state) for state in ("done", "failed", "running", "left")}
    write_text(out / "cells.csv", _cells_csv(results))
    if rows:
        write_text(out / f"{FIGURE}.csv", _rows_csv(rows))
        ablation_figure(rows, objects, out / f"{FIGURE}.svg")
        write_text(out / "README.md", readme(plan, rows, differences, counts))
    place.keep_tables()
    return {
        "out": str(place),
        "states": counts,
        "cells": [cell_json(cell, result) for cell, result in results.items()],
        "failed": [
            {"cell": cell.name, "why": folder.failure(cell)} for cell, state in state_of.items() if state == "failed"
        ],
        "rows": [asdict(row) for row in rows],
        "differences": [asdict(row) for row in differences],
        "objects": [asdict(row) for row in objects],
    }


def cell_json(cell: Cell, result: CellResult) -> dict[str, Any]:
    """A cell as ``ablate --json`` has it."""
    return {
        "channels": cell.channels,
        "size": cell.size,
        "trial": cell.trial,
        "dataset": cell.dataset,
        **dict(cell.varied),
        "accuracy": result.tested.accuracy,
        "auc": result.tested.auc,
        "loss": result.tested.loss,
        "tested": result.tested.attempts,
        "trained_on": result.trained_on,
        "epochs": result.epochs,
        "kept_epoch": result.kept_epoch,
        "seconds": result.seconds,
    }


def print_found(found: Mapping[str, Any]) -> None:
    """The tables of a sweep."""
    if found["rows"]:
        cells = [
            (
                row["series"],
                size_text(row["size"]),
                str(row["accuracy"]["trials"]),
                f"{row['accuracy']['mean']:.3f}",
                _interval(row["accuracy"]),
                f"{row['auc']['mean']:.3f}",
                _interval(row["auc"]),
            )
            for row in found["rows"]
        ]
        interval = Column(heading="95 % interval", rank=1)
        print_table(("series", "attempts", "trials", "accuracy", interval, "AUC", interval), cells)
        console.print()
    if found["differences"]:
        console.print("differences in balanced accuracy, trial by trial")
        compared = [
            (
                f"{row['series']} - {row['against']}",
                size_text(row["size"]),
                str(row["accuracy"]["trials"]),
                f"{row['accuracy']['mean']:+.3f}",
                _interval(row["accuracy"], sign="+"),
                "-" if row["accuracy"]["p"] is None else f"{row['accuracy']['p']:.2g}",
            )
            for row in found["differences"]
        ]
        print_table(
            ("series", "attempts", "trials", "difference", Column(heading="95 % interval", rank=1), "p"), compared
        )
        console.print()
    for failure in found["failed"]:
        console.print(f"{failure['cell']} failed: {failure['why']}")


def print_objects(found: Mapping[str, Any]) -> None:
    """The objects that were judged worst."""
    worst = sorted(found["objects"], key=lambda row: row["correct"] / row["attempts"])[:_WORST]
    if worst:
        console.print(f"objects judged worst, {len(worst)} of {len(found['objects'])}")
        cells = [
            (row["object"], f"{row['correct']}/{row['attempts']}", f"{row['correct'] / row['attempts']:.1%}")
            for row in worst
        ]
        print_table(("object", "judged rightly", "share"), cells)
        console.print()


def print_estimate(plan: SweepPlan, left: Estimate, workers: int) -> None:
    """What is left to do, and how long it takes."""
    sizes = ", ".join(size_text(size) for size in plan.sizes)
    varied = "".join(f", {name} {' and '.join(values)}" for name, values in plan.varied.items())
    console.print(f"{', '.join(plan.channels)}; training sets of {sizes}{varied}; {counted(plan.trials, 'trial')}")
    passes = f"{counted(round(left.passes), 'pass', 'passes')} a cell"
    console.print(
        f"{counted(left.cells, 'cell')} left: {samples_text(left.samples)} in {passes}, "
        f"{left.samples_per_s:,.0f}/s with a worker: about {duration_text(left.seconds)} on "
        f"{counted(workers, 'worker')}"
    )


def samples_text(samples: float) -> str:
    """How many samples will be learnt from, which is known roughly."""
    return f"{samples / 1e6:.1f} M samples" if samples >= 1e5 else counted(round(samples), "sample")


def duration_text(seconds: float) -> str:
    """A time that is known roughly."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def size_text(size: int | None) -> str:
    """The size of a training set as it is typed."""
    return "all" if size is None else str(size)


def _interval(mean: Mapping[str, Any], *, sign: str = "") -> str:
    return "-" if mean["low"] is None else f"{mean['low']:{sign}.3f} - {mean['high']:{sign}.3f}"


def _cells_csv(results: Mapping[Cell, CellResult]) -> str:
    lines = [{"cell": cell.name, **cell_json(cell, result)} for cell, result in results.items()]
    return _csv(lines)


def _rows_csv(rows: Sequence[Any]) -> str:
    def flat(name: str, mean: MeanOverTrials) -> dict[str, Any]:
        return {name: mean.mean, f"{name}_low": mean.low, f"{name}_high": mean.high}

    return _csv(
        [
            {
                "series": row.series,
                "size": size_text(row.size),
                "trained_on": row.trained_on,
                "trials": row.accuracy.trials,
                **flat("accuracy", row.accuracy),
                **flat("auc", row.auc),
            }
            for row in rows
        ]
    )


def _csv(lines: Sequence[Mapping[str, Any]]) -> str:
    text = io.StringIO()
    if lines:
        writer = csv.DictWriter(text, fieldnames=list(lines[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)
    return text.getvalue()
