"""``handsight runs``: what was trained, where it came from, and in what it differs."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from handsight.cli.completion import complete_run
from handsight.cli.errors import CommandError
from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app
from handsight.cli.options import Json
from handsight.cli.output import bold, console, print_json
from handsight.cli.tables import Column, print_facts, print_prose, print_table, short_time, written
from handsight.datasets.errors import counted
from handsight.training.run_folder import RUN_RECORD, check_finished_run
from handsight.training.run_record import RECORD_SHA256, origins_of, read_values

if TYPE_CHECKING:
    from handsight.training.run_comparison import Difference
    from handsight.training.run_figures import RunFigures
    from handsight.training.run_files import FileCheck
    from handsight.training.run_list import ListedRun


class RunsGroup(LazyGroup):
    """Everything behind ``handsight runs``."""

    table = (
        LazyCommand(
            "ls", "runs:ls", "List the runs below some folders.", ("handsight runs ls", "handsight runs ls runs --json")
        ),
        LazyCommand(
            "show",
            "runs:show",
            "Print everything a run says of itself, and check its weights.",
            ("handsight runs show runs/rgbd",),
        ),
        LazyCommand(
            "compare",
            "runs:compare",
            "Show in what runs differ, and their figures.",
            ("handsight runs compare runs/rgbd runs/depth",),
        ),
    )


runs_app = lazy_app(RunsGroup, help="List, inspect and compare trained runs.")

COLUMNS = (
    "run",
    Column(heading="created (UTC)", rank=5, short=short_time),
    Column(heading="channels", rank=3),
    Column(heading="data", rank=4, prose="clip"),
    Column(heading="attempts", rank=2),
    Column(heading="kept", rank=6),
    Column(heading="AUC", rank=1),
    Column(heading="accuracy", rank=1),
    Column(heading="loss", rank=1),
    Column(heading="parameters", rank=7),
)
"""One line a run; accuracy is balanced, and the last figures are on held-out attempts."""


def ls(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FOLDER]...", help="Runs in and below these are listed; else those below this one."),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the runs in and below some folders, the newest last.

    Figures are those of the pass that was kept, on attempts that were held out. A run that cannot be read is named with
    the reason. Folders below a run or in a dataset are not looked at, nor is what begins with a dot.
    """
    from handsight.training.run_list import list_runs  # once it is called

    listed = list_runs(folders or [Path()])
    if as_json:
        print_json([_json_row(one) for one in listed])
        return
    if not listed:
        print_prose(f"no run in or below {', '.join(map(str, folders)) if folders else 'this folder'}")
    rows = [_row(one.run, one.figures) for one in listed if one.figures is not None]
    if rows:
        print_table(COLUMNS, rows)
    for one in listed:
        if one.fault is not None:
            print_prose(one.fault)


def show(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a trained run.", autocompletion=complete_run)],
    as_json: Json = False,
) -> None:
    """Print everything a run says of itself, and check its weights.

    The exit status is 1 where the weights are not those that the record names.
    """
    from handsight.training.run_figures import figures_of  # once it is called
    from handsight.training.run_files import check_files

    record = _record(run)
    figures, files = figures_of(record), check_files(run, record)
    if as_json:
        print_json(
            {"run": run, "ok": files.weights_fault is None, "figures": figures, "files": files, "record": record}
        )
    else:
        console.print(bold(run))
        print_facts(_facts(record, figures, files), indent=2)
        for origin in origins_of(record):
            console.print("trained on ", bold(origin["dataset"]))
            print_facts(((name, _cell(value)) for name, value in origin.items() if name != "dataset"), indent=2)
        console.print("recipe")
        print_facts(_recipe(record), indent=2)
        _print_curve(record)
    if files.weights_fault is not None:
        raise typer.Exit(1)


def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN RUN...", help="Folders of two or more trained runs.", autocompletion=complete_run),
    ],
    as_json: Json = False,
) -> None:
    """Show in what settings and data runs differ, and their figures on held-out attempts side by side."""
    if len(runs) < 2:
        raise CommandError(f"{counted(len(runs), 'run')} to compare, expected two or more")
    from handsight.training.run_comparison import differences, held_out_alike  # once it is called
    from handsight.training.run_figures import figures_of

    records = [_record(run) for run in runs]
    found, alike = differences(records), held_out_alike(records)
    figures = [figures_of(record) for record in records]
    if as_json:
        print_json(
            {
                "runs": [{"run": run, **_plain(one)} for run, one in zip(runs, figures, strict=True)],
                "differences": {one.name: one.values for one in found},
                "held_out_alike": alike,
            }
        )
        return
    names = _short_names(runs)
    print_table(COLUMNS, [_row(name, one) for name, one in zip(names, figures, strict=True)])
    _print_differences(found, names)
    if not alike:
        print_prose("figures are of other held-out attempts in each run: data, seed or holdout differ")


def _record(run: Path) -> dict[str, Any]:
    check_finished_run(run)
    return read_values(run / RUN_RECORD)


def _plain(figures: RunFigures) -> dict[str, Any]:
    from dataclasses import asdict

    return asdict(figures)


def _json_row(one: ListedRun) -> dict[str, Any]:
    return {"run": one.run, "fault": one.fault, **({} if one.figures is None else _plain(one.figures))}


def _row(name: str, figures: RunFigures) -> tuple[str, ...]:
    return (
        name,
        written(figures.created or "-"),
        figures.channels,
        ", ".join(one.rpartition("/")[2] for one in figures.data),
        str(figures.attempts),
        "-" if figures.kept is None else f"{figures.kept}/{figures.passes}",
        _figure(figures.auc),
        _figure(figures.accuracy),
        _figure(figures.loss),
        "-" if figures.parameters is None else str(figures.parameters),
    )


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _facts(record: Mapping[str, Any], figures: RunFigures, files: FileCheck) -> Iterable[tuple[str, str]]:
    from handsight.training.run_figures import input_words  # once it is called

    grid, network = record["grid"], record["settings"]["network"]
    yield "written", f"{figures.created or '-'} by handsight {figures.handsight or '-'}"
    yield "network", f"{figures.channels}, {_cell(figures.parameters)} parameters"
    yield "widths", f"{_cell(network['widths'])}; kernels {_cell(network['kernels'])}; dense {_cell(network['dense'])}"
    yield "padded", _cell(network.get("padded"))
    yield "input", input_words(grid)
    yield "attempts", str(figures.attempts)
    yield "kept", "-" if figures.kept is None else f"pass {figures.kept} of {figures.passes}"
    yield (
        "held out",
        f"balanced accuracy {_figure(figures.accuracy)}, AUC {_figure(figures.auc)}, loss {_figure(figures.loss)} on "
        f"{counted(figures.held_out, 'attempt') if figures.held_out is not None else '-'}",
    )
    yield "weights", f"{figures.weights_sha256 or '-'} {_weights_state(files)}"
    yield "record", _cell(record.get(RECORD_SHA256))
    yield "card", files.card


def _weights_state(files: FileCheck) -> str:
    if files.weights_fault is not None:
        return f"not those of this run: {files.weights} {files.weights_fault}"
    return (
        f"as {files.weights} is" if files.weights_named else f"(the record does not say of which {files.weights} it is)"
    )


def _recipe(record: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    for name, value in record["settings"].items():
        if name == "network":
            continue
        if isinstance(value, Mapping):
            yield from ((f"{name}.{key}", _cell(part)) for key, part in value.items())
        else:
            yield name, _cell(value)


def _print_curve(record: Mapping[str, Any]) -> None:
    rows = [
        (
            str(one["number"]),
            f"{one['train_loss']:.4f}",
            *(_figure(one["held_out"][name]) for name in ("loss", "auc", "accuracy")),
            "kept" if one["number"] == record.get("kept_epoch") else "",
        )
        for one in record["history"]
    ]
    if rows:
        print_table(("pass", "train loss", "held-out loss", "AUC", "accuracy", ""), rows)


def _print_differences(found: Sequence[Difference], names: Sequence[str]) -> None:
    if not found:
        print_prose("no setting, grid or origin differs")
        return
    # Where room is short, the last runs are left out first; two are always shown.
    columns = [Column(heading=name, rank=max(0, at - 1), prose="clip") for at, name in enumerate(names)]
    print_table(["differs", *columns], [(one.name, *map(_cell, one.values)) for one in found])


def _short_names(runs: Sequence[Path]) -> list[str]:
    """The folders without what all of them begin with, as far as every one keeps a name."""
    whole = [run.absolute() for run in runs]
    common = os.path.commonpath([one.parent for one in whole])
    return [os.path.relpath(one, common) for one in whole]


def _cell(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ", ".join(map(_cell, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
