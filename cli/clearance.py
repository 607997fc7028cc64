"""``handsight clearance``: tables cleared object by object, as VGN and GG-CNN are measured."""

from __future__ import annotations

from typing import Annotated

import typer

from handsight.cli.completion import words
from handsight.cli.options import (
    DEFAULT_GRIPPER,
    DEFAULT_METHOD,
    DEFAULT_THRESHOLD,
    EVALUATION_SEED,
    METHOD_NAMES,
    MOST_TRIALS,
    NOVEL_OBJECTS,
    Gripper,
    Json,
    Model,
    Objects,
    PerScene,
    Threshold,
    TrialSeed,
    Workers,
)
from handsight.cli.output import errors, print_json
from handsight.training.run_folder import check_finished_run


def clearance_command(
    model: Model,
    methods: Annotated[
        str,
        typer.Option(
            metavar="A,B,C",
            help="Servo methods; the others are compared with the first.",
            autocompletion=words(*METHOD_NAMES),
        ),
    ] = DEFAULT_METHOD,
    objects: Objects = NOVEL_OBJECTS,
    per_scene: PerScene = None,
    tables: Annotated[
        int, typer.Option("--tables", "-n", max=MOST_TRIALS, help="Tables that each method clears.")
    ] = 20,
    failures: Annotated[
        int, typer.Option(max=MOST_TRIALS, help="Grasps in a row that bring nothing and end a table.")
    ] = 3,
    gripper: Gripper = DEFAULT_GRIPPER,
    threshold: Threshold = DEFAULT_THRESHOLD,
    seed: TrialSeed = EVALUATION_SEED,
    workers: Workers = 2,
    as_json: Json = False,
) -> None:
    """Grasp until the table is empty or nothing comes of it any more, with every method on the same tables."""
    check_finished_run(model)
    from handsight.cli.wiring.clearances import clear_with_model, print_clearances
    from handsight.evaluation.clearance import ClearanceSettings
    from handsight.evaluation.evaluate import method_names
    from handsight.servoing.loop import ServoSettings

    settings = ClearanceSettings(
        methods=tuple(method_names(methods)),
        tables=tables,
        failures=failures,
        seed=seed,
        workers=workers,
        servo=ServoSettings(threshold=threshold),
    )
    results = clear_with_model(model, objects, settings, gripper=gripper, per_scene=per_scene)
    if as_json:
        print_json(results)
    else:
        print_clearances(results)
    if results["fault"] is not None:
        errors.print(f"error: {results['fault']}")
        raise typer.Exit(1)
