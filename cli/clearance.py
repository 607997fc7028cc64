"""``handsight clearance``: tables cleared object by object, as VGN and GG-CNN are measured."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.completion import words
from handsight.cli.opening import check_out_file
from handsight.cli.options import (
    DEFAULT_GRIPPER,
    DEFAULT_METHOD,
    DEFAULT_THRESHOLD,
    EVALUATION_SEED,
    METHOD_NAMES,
    MOST_TRIALS,
    NOVEL_OBJECTS,
    EngineName,
    Gripper,
    Json,
    Level,
    Model,
    Objects,
    PerScene,
    RayAddress,
    Threshold,
    TrialSeed,
    Workers,
)
from handsight.cli.output import errors, print_json
from handsight.cli.wiring.engines import check_engine, engine_named
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
    level: Level = False,
    seed: TrialSeed = EVALUATION_SEED,
    workers: Workers = 2,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE", help="Journal of the tables; the same call goes on with it after an interruption."
        ),
    ] = None,
    engine: EngineName = "local",
    ray_address: RayAddress = None,
    as_json: Json = False,
) -> None:
    """Grasp until the table is empty or nothing comes of it any more, with every method on the same tables."""
    check_engine(engine, ray_address)
    check_finished_run(model)
    if out is not None:
        check_out_file(out)
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
        servo=ServoSettings(threshold=threshold, level=level),
    )
    with engine_named(engine, ray_address, workers) as started:
        results = clear_with_model(
            model, objects, settings, gripper=gripper, per_scene=per_scene, out=out, engine=started
        )
    if as_json:
        print_json(results)
    else:
        print_clearances(results)
    if results["fault"] is not None:
        errors.print(f"error: {results['fault']}")
        raise typer.Exit(1)
