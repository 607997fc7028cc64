"""What a report tells of a sweep: accuracy by size and channels (figure 7), differences, and the worst objects."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path

from handsight.datasets.errors import counted
from handsight.training.intervals import MeanOverTrials
from handsight.training.sweep.folder import SweepFolder
from handsight.training.sweep.plan import SweepPlan, read_plan
from handsight.training.sweep.table import (
    ObjectRow,
    SweepDifference,
    SweepRow,
    object_rows,
    sweep_differences,
    sweep_rows,
)
from handsight.viz.errors import ReportError
from handsight.viz.figures.ablation import ablation_figure
from handsight.viz.report.content import Block, Facts, Figure, Note, Section, Table, shown_rows
from handsight.viz.report.embedding import embedded_svg
from handsight.viz.report.words import count, percent, said

MOST_OBJECTS = 100


def sweep_section(folder: Path, command: str) -> Section:
    """The figure and the tables of a sweep, from the cells that are done.

    Args:
        folder: Of the sweep.
        command: The call that has its plan.

    Raises:
        SweepFolderError: The folder has no plan, or a damaged one.
        ReportError: No cell is done.
    """
    plan, cells = read_plan(folder), SweepFolder(folder)
    results = cells.results(plan.cells())
    if not results:
        raise ReportError(
            f"{folder} holds a sweep of which no cell is done, expected at least one: see 'handsight ablate --help'"
        )
    states = [cells.state(cell) for cell in plan.cells()]
    failed = [(cell.name, cells.failure(cell)) for cell in plan.cells() if cells.state(cell) == "failed"]
    named = plan.dataset_names
    rows, objects = sweep_rows(results, named), object_rows(results, named)
    plot = f"handsight ablate plot {shlex.quote(str(folder))}"
    tally = {state: states.count(state) for state in ("done", "failed", "running", "left")}
    differences = sweep_differences(results, named)
    blocks = [_figure(rows, objects, plot), _rows(rows, plot), *_differences(differences, plot)]
    if failed:
        blocks.append(
            Table(caption="Cells that failed", head=("cell", "why"), rows=tuple(failed), prose=frozenset({1}))
        )
    return Section(
        title=f"Sweep {folder}",
        blocks=(_facts(plan, tally), Note(text="What was trained and how, in one call:", command=command)),
        parts=(
            Section(title="Accuracy by size of the training set", blocks=tuple(blocks)),
            Section(title="Objects never seen", blocks=(_objects(objects, plot),)),
            Section(title="Lineage", blocks=(_data(plan),)),
        ),
    )


def _facts(plan: SweepPlan, tally: Mapping[str, int]) -> Facts:
    return Facts(
        rows=(
            ("reads", ", ".join(plan.channels)),
            ("training sets", ", ".join(map(_size, plan.sizes))),
            ("varied", said({name: list(values) for name, values in plan.varied.items()})),
            ("trials", f"{plan.trials}, each holds out {percent(plan.held_out)} of the groups by {plan.by}"),
            ("cells", ", ".join(f"{number} {state}" for state, number in tally.items() if number)),
            ("handsight", plan.handsight),
        )
    )


def _figure(rows: list[SweepRow], objects: list[ObjectRow], command: str) -> Figure:
    told = "; ".join(f"{row.series} {percent(row.accuracy.mean)} at {row.trained_on:,.0f}" for row in rows)
    return Figure(
        picture=embedded_svg(lambda path: ablation_figure(rows, objects, path)),
        alt=f"Curves of balanced accuracy and area under the ROC curve over the size of the training set: {told}.",
        caption=(
            "Balanced accuracy and area under the ROC curve on objects never seen, by the size of the training set "
            "(figure 7 of the paper), and by object at the largest size."
        ),
        command=command,
    )


def _rows(rows: list[SweepRow], command: str) -> Table:
    return Table(
        caption="Means over trials, with 95 % intervals that take the overlap of training sets into account",
        head=("series", "attempts", "trials", "accuracy", "95 % interval", "AUC", "95 % interval of AUC"),
        rows=tuple(
            (
                row.series,
                f"{row.trained_on:,.0f}",
                count(row.accuracy.trials),
                f"{row.accuracy.mean:.3f}",
                _interval(row.accuracy),
                f"{row.auc.mean:.3f}",
                _interval(row.auc),
            )
            for row in rows
        ),
        command=command,
    )


def _differences(rows: list[SweepDifference], command: str) -> list[Block]:
    if not rows:
        return [Note(text="No two series can be compared trial by trial.")]
    table = Table(
        caption="Differences in balanced accuracy, trial by trial",
        head=("series", "attempts", "trials", "difference", "95 % interval", "p"),
        rows=tuple(
            (
                f"{row.series} less {row.against}",
                _size(row.size),
                count(row.accuracy.trials),
                f"{row.accuracy.mean:+.3f}",
                _interval(row.accuracy, sign="+"),
                "–" if row.accuracy.p is None else f"{row.accuracy.p:.2g}",
            )
            for row in rows
        ),
        command=command,
    )
    return [table]


def _objects(objects: list[ObjectRow], command: str) -> Table:
    ordered = sorted(objects, key=lambda row: (row.correct / row.attempts, row.object, row.series))
    rows, left = shown_rows(
        tuple(
            (row.object, row.series, _size(row.size), count(row.correct), count(row.attempts), _share(row))
            for row in ordered
        ),
        MOST_OBJECTS,
    )
    return Table(
        caption=f"Judged rightly at S > 0.5, the worst first; {counted(len(ordered), 'row')}{left}",
        head=("object", "series", "training set", "rightly", "attempts", "share"),
        rows=rows,
        prose=frozenset({1}),
        command=command,
        folded=True,
    )


def _share(row: ObjectRow) -> str:
    return percent(row.correct / row.attempts)


def _data(plan: SweepPlan) -> Table:
    return Table(
        caption="Data",
        head=("dataset", "version", "labelled attempts", "picture", "snapshot", "content digest"),
        rows=tuple(
            (one.address, one.ref, count(one.attempts), one.viewpoint, one.snapshot, one.digest)
            for one in plan.datasets
        ),
        prose=frozenset({1, 3, 4, 5}),
    )


def _size(size: int | None) -> str:
    return "all" if size is None else count(size)


def _interval(mean: MeanOverTrials, *, sign: str = "") -> str:
    return "–" if mean.low is None or mean.high is None else f"{mean.low:{sign}.3f} to {mean.high:{sign}.3f}"
