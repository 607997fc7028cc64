"""``handsight prediction``: how wrong the homography's pictures are, by step and by object (section VI-E)."""

from __future__ import annotations

from typing import Annotated

import typer

from handsight.cli.options import (
    DEFAULT_GRIPPER,
    EVALUATION_SEED,
    MOST_TRIALS,
    NOVEL_OBJECTS,
    Gripper,
    Json,
    Model,
    Objects,
    TrialSeed,
    Workers,
)
from handsight.cli.output import errors, print_json
from handsight.training.run_folder import check_finished_run


def prediction_command(
    model: Model,
    objects: Objects = NOVEL_OBJECTS,
    scenes: Annotated[
        int,
        typer.Option("--scenes", "-n", max=MOST_TRIALS, help="Scenes, each with a grasp and a step of every size."),
    ] = 100,
    gripper: Gripper = DEFAULT_GRIPPER,
    seed: TrialSeed = EVALUATION_SEED,
    workers: Workers = 2,
    as_json: Json = False,
) -> None:
    """Compare predicted pictures with those taken after the step, and the network's scores of both (section VI-E)."""
    check_finished_run(model)
    from handsight.cli.wiring.predictions import print_predictions, survey_predictions
    from handsight.evaluation.prediction_survey import SurveySettings

    settings = SurveySettings(scenes=scenes, seed=seed, workers=workers)
    results = survey_predictions(model, objects, settings, gripper=gripper)
    if as_json:
        print_json(results)
    else:
        print_predictions(results)
    if results["fault"] is not None:
        errors.print(f"error: {results['fault']}")
        raise typer.Exit(1)
