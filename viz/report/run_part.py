"""What a report tells of a trained run."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from handsight.datasets.errors import counted
from handsight.training.card import limits
from handsight.training.run_figures import RunFigures, figures_of, input_words, version_of
from handsight.training.run_files import FileCheck, check_files
from handsight.training.run_folder import RUN_RECORD, check_finished_run
from handsight.training.run_record import RECORD_SHA256, origins_of, read_values
from handsight.viz.figures.training_curve import training_curve_figure
from handsight.viz.report.content import Block, Facts, Figure, Points, Section, Table
from handsight.viz.report.embedding import embedded_svg
from handsight.viz.report.words import count, figure, said, written


def run_section(folder: Path) -> Section:
    """Figures, curve, data, recipe and limits of a run.

    Raises:
        CheckpointError: The folder holds no finished run, or a damaged one.
        OSError: A file cannot be read.
    """
    check_finished_run(folder)
    record = read_values(folder / RUN_RECORD)
    figures, files = figures_of(record), check_files(folder, record)
    name = shlex.quote(str(folder))
    return Section(
        title=f"Run {folder}",
        blocks=(Facts(rows=_facts(record, figures)),),
        parts=(
            _course(record, figures, name),
            Section(title="Limits", blocks=(Points(texts=_limits(record)),)),
            Section(title="Recipe", blocks=(Facts(rows=_recipe(record)),)),
            _lineage(record, figures, files, name),
        ),
    )


def _facts(record: Mapping[str, Any], figures: RunFigures) -> tuple[tuple[str, str], ...]:
    grid = record["grid"]
    kept = "–" if figures.kept is None else f"pass {figures.kept} of {figures.passes}"
    return (
        ("reads", figures.channels),
        ("parameters", "–" if figures.parameters is None else count(figures.parameters)),
        ("input", input_words(grid)),
        ("attempts", count(figures.attempts)),
        ("kept", kept),
        ("held out", "–" if figures.held_out is None else counted(figures.held_out, "attempt")),
        ("balanced accuracy", figure(figures.accuracy)),
        ("AUC", figure(figures.auc)),
        ("cross-entropy", figure(figures.loss, 4)),
    )


def _course(record: Mapping[str, Any], figures: RunFigures, name: str) -> Section:
    history = record["history"]
    if not history:
        return Section(title="Training", blocks=(Points(texts=("The record has no pass over the data.",)),))
    rows = tuple(
        (
            str(one["number"]) + (" (kept)" if one["number"] == figures.kept else ""),
            f"{one['train_loss']:.4f}",
            figure(one["held_out"]["loss"], 4),
            figure(one["held_out"]["auc"]),
            figure(one["held_out"]["accuracy"]),
        )
        for one in history
    )
    last = history[-1]
    blocks: tuple[Block, ...] = (
        Figure(
            picture=embedded_svg(lambda path: training_curve_figure(record, path)),
            alt=(
                f"Curves of the training over {counted(figures.passes, 'pass', 'passes')}: the training loss ends at "
                f"{last['train_loss']:.4f}, that of held-out attempts at {figure(last['held_out']['loss'], 4)}. "
                "All numbers are in the table below."
            ),
            caption="Losses and figures on held-out attempts, pass by pass.",
            command=f"handsight runs show {name}",
        ),
        Table(
            caption="The same in numbers",
            head=("pass", "training loss", "held-out loss", "AUC", "balanced accuracy"),
            rows=rows,
            command=f"handsight runs show {name}",
            folded=len(rows) > 8,
        ),
    )
    return Section(title="Training", blocks=blocks)


def _limits(record: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(statement.replace("`", "") for statement in limits(record))


def _recipe(record: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    return tuple((name, said(value)) for name, value in record["settings"].items())


def _lineage(record: Mapping[str, Any], figures: RunFigures, files: FileCheck, name: str) -> Section:
    weights = "as the record names them" if files.weights_named else "the record does not name them"
    if files.weights_fault is not None:
        weights = f"not those of the record: {files.weights} {files.weights_fault}"
    facts = Facts(
        rows=(
            ("written", f"{written(figures.created)} by handsight {figures.handsight or '–'}"),
            ("weights", f"{figures.weights_sha256 or '–'} (SHA-256), {weights}"),
            ("record", str(record.get(RECORD_SHA256, "–"))),
            ("card", files.card),
            ("selection", said(record.get("selection"))),
        )
    )
    table = Table(
        caption="Trained on",
        head=("version", "attempts", "picture", "snapshot", "content digest"),
        rows=tuple(
            (version_of(one), count(one["attempts"]), one["view"], one["snapshot"], one["digest"])
            for one in origins_of(dict(record))
        ),
        prose=frozenset({2, 3, 4}),
        command=f"handsight runs show {name}",
    )
    return Section(title="Lineage", blocks=(facts, table))
