"""``handsight evaluate``: success of servo methods, with n and 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from handsight.cli.completion import words
from handsight.cli.options import (
    DEFAULT_GRIPPER,
    DEFAULT_THRESHOLD,
    EVALUATION_SEED,
    METHOD_NAMES,
    MOST_TRIALS,
    NOVEL_OBJECTS,
    Gripper,
    Json,
    Model,
    Objects,
    Threshold,
    TrialSeed,
    Workers,
)
from handsight.cli.output import console, errors, print_json, progress_bar
from handsight.cli.tables import Column, print_table
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    # PyTorch and PyBullet take seconds; nothing is imported where there is no run.
    from handsight.evaluation.evaluate import EvaluationSettings
    from handsight.evaluation.results import ResultRow


def evaluate_command(
    model: Model,
    methods: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,C", help="Servo methods; all there are unless given.", autocompletion=words(*METHOD_NAMES)
        ),
    ] = None,
    objects: Objects = NOVEL_OBJECTS,
    trials: Annotated[int, typer.Option("--trials", "-n", max=MOST_TRIALS, help="Trials of each method.")] = 100,
    station: Annotated[Literal["sim"], typer.Option(help="Where to try.")] = "sim",
    gripper: Gripper = DEFAULT_GRIPPER,
    threshold: Threshold = DEFAULT_THRESHOLD,
    seed: TrialSeed = EVALUATION_SEED,
    workers: Workers = 2,
    as_json: Json = False,
) -> None:
    """Compare servo methods on the same scenes and starting poses (section V-B.2)."""
    check_finished_run(model)
    from handsight.evaluation.evaluate import EvaluationSettings, method_names
    from handsight.servoing.loop import ServoSettings
    from handsight.servoing.methods.registry import METHODS

    settings = EvaluationSettings(
        methods=tuple(METHODS if methods is None else method_names(methods)),
        trials=trials,
        seed=seed,
        workers=workers,
        servo=ServoSettings(threshold=threshold),
    )
    results = evaluate_model(model, objects, settings, gripper=gripper)
    if as_json:
        print_json(results)
    else:
        print_results(results["rows"])
    if results["fault"] is not None:
        errors.print(f"error: {results['fault']}")
        raise typer.Exit(1)


def evaluate_model(
    model: Path, objects: str, settings: EvaluationSettings, *, gripper: str = DEFAULT_GRIPPER
) -> dict[str, Any]:
    """Run the trials behind a progress bar; returns what ``evaluate --json`` prints."""
    from handsight.cli.wiring.stations import sim_station
    from handsight.evaluation.evaluate import TrialContextFactory, evaluate
    from handsight.evaluation.results import result_rows, why_nothing_counts
    from handsight.servoing.methods.registry import METHODS
    from handsight.training.run import load_run

    run = load_run(model)
    factory = TrialContextFactory(
        open_station=sim_station(objects, gripper=gripper), run=model, weights_sha256=run.weights_sha256
    )
    with progress_bar("evaluate", settings.trials * len(settings.methods)) as bar:
        done = evaluate(factory, settings, on_trial=lambda trial: bar.advance())
    return {
        "rows": result_rows(done, objects=objects, methods=settings.methods),
        "model": str(model),
        "weights_sha256": run.weights_sha256,
        "dataset_digest": run.origin.digest,
        "gripper": gripper,
        "seed": settings.seed,
        "threshold": settings.servo.threshold,
        "methods": [METHODS[name].to_json() for name in settings.methods],
        "trials": [
            {
                "number": t.number,
                "method": t.method,
                "success": t.success,
                "moves": t.moves,
                "failure": t.failure,
                "aborted": t.aborted,
            }
            for t in done
        ],
        "fault": why_nothing_counts(done),
    }


def print_results(rows: Sequence[ResultRow]) -> None:
    """The table of results."""
    cells = [
        (
            row["method"],
            row["objects"],
            f"{row['successes']}/{row['trials']}",
            f"{row['rate']:.1%}" if row["trials"] else "-",
            f"{row['ci95'][0]:.1%} - {row['ci95'][1]:.1%}" if row["trials"] else "-",
            str(row["aborted"]),
            "-" if row["mean_steps"] is None else f"{row['mean_steps']:.1f}",
            "-" if row["step_ms"] is None else f"{row['step_ms']:.1f}",
        )
        for row in rows
    ]
    columns = (
        "method",
        Column(heading="objects", rank=4),
        "grasped",
        "success",
        Column(heading="95 % interval", rank=1),
        Column(heading="aborted", rank=2),
        Column(heading="moves", rank=3),
        Column(heading="ms/step", rank=5),
    )
    print_table(columns, cells)
    console.print()
