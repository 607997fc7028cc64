"""``handsight servo``: one servo run, recorded for the Rerun viewer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from handsight.cli.completion import words
from handsight.cli.errors import CommandError
from handsight.cli.opening import check_out_file, check_rig_option
from handsight.cli.options import (
    DEFAULT_GRIPPER,
    DEFAULT_METHOD,
    DEFAULT_THRESHOLD,
    EVALUATION_SEED,
    METHOD_NAMES,
    MOST_TRIALS,
    NOVEL_OBJECTS,
    RIG_THRESHOLD,
    Gripper,
    Json,
    Level,
    Live,
    LiveUrl,
    Model,
    Objects,
    TrialSeed,
)
from handsight.cli.output import bold, console, print_json, progress_bar
from handsight.datasets.errors import counted, pasteable
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    # PyTorch, PyBullet and Rerun take seconds; nothing is imported where there is no run.
    import numpy as np
    from numpy.typing import NDArray

    from handsight.collection.ur10.station_factory import Ur10StationFactory
    from handsight.evaluation.trial import TrialRecording


def servo_command(
    model: Model,
    out: Annotated[Path, typer.Option("--out", help="Recording to write, for 'rerun FILE'.")] = Path("servo.rrd"),
    method: Annotated[str, typer.Option(help="Servo method.", autocompletion=words(*METHOD_NAMES))] = DEFAULT_METHOD,
    trial: Annotated[
        int, typer.Option(min=0, max=MOST_TRIALS, help="Which trial; begins like the same trial of 'evaluate'.")
    ] = 0,
    objects: Objects = NOVEL_OBJECTS,
    station: Annotated[Literal["sim", "ur10"], typer.Option(help="Where to servo.")] = "sim",
    rig: Annotated[
        Path | None, typer.Option("--rig", metavar="FILE", help="The rig's file, for --station ur10; see docs/rig.md.")
    ] = None,
    gripper: Gripper = DEFAULT_GRIPPER,
    threshold: Annotated[
        float | None,
        typer.Option(
            help=f"Predicted success at which the grasp is executed; unless given {DEFAULT_THRESHOLD}, and "
            f"{RIG_THRESHOLD} on a rig."
        ),
    ] = None,
    level: Level = False,
    seed: TrialSeed = EVALUATION_SEED,
    scene_camera: Annotated[
        bool, typer.Option("--scene-camera", help="Also record the whole station from outside at every step.")
    ] = False,
    live: Live = False,
    live_url: LiveUrl = None,
    as_json: Json = False,
) -> None:
    """Servo once from a random pose, grasp, and record every step."""
    check_finished_run(model)
    check_rig_option(station, rig)
    if rig is not None and scene_camera:
        raise CommandError("--scene-camera is of the simulated station: nothing looks at a rig from outside")
    check_out_file(out)
    from handsight.cli.wiring.live import check_live, live_watch

    check_live(live=live, url=live_url)
    from handsight.cli.wiring.scene_pictures import servo_pictures
    from handsight.cli.wiring.stations import sim_station
    from handsight.evaluation.evaluate import TrialContextFactory, record_trial
    from handsight.servoing.loop import ServoSettings
    from handsight.servoing.methods.registry import servo_method

    servo_method(method)
    if threshold is None:
        threshold = DEFAULT_THRESHOLD if rig is None else RIG_THRESHOLD
    simulated = sim_station(objects, gripper=gripper) if rig is None else None
    settings = ServoSettings(threshold=threshold, level=level)
    with live_watch(live=live, url=live_url) as watch:
        factory = TrialContextFactory(open_station=simulated or _rig_station(rig), run=model, watch=watch)
        recording = record_trial(factory, method, trial, seed=seed, servo=settings)
        if recording is None:
            raise CommandError(f"method is {method!r}, which does not servo, expected one that does")
        outside = servo_pictures(simulated.config, recording) if scene_camera and simulated else None
        write_trace(out, recording, model, outside)
        _tell(recording, out, method, seed, as_json=as_json)


def _tell(recording: TrialRecording, out: Path, method: str, seed: int, *, as_json: bool) -> None:
    """What came of it."""
    if as_json:
        print_json(
            {
                "recording": out,
                "method": method,
                "trial": recording.trial.number,
                "seed": seed,
                "moves": recording.trace.moves,
                "predicted_success": recording.trace.grasp_score,
                "success": recording.trial.success,
            }
        )
        return
    result = "held" if recording.trial.success else "missed"
    console.print(
        bold(out),
        f": {method}, {counted(recording.trace.moves, 'move')}, predicted success "
        f"{recording.trace.grasp_score:.2f}, {result}; open it with {pasteable('handsight', 'view', 'trace', out)}",
    )


def _rig_station(rig: Path | None) -> Ur10StationFactory:
    from handsight.cli.wiring.rigs import rig_station

    if rig is None:
        raise CommandError("--station ur10 needs the rig's file: --rig FILE")
    return rig_station(rig, rig.parent)


def write_trace(
    out: Path, recording: TrialRecording, model: Path, outside: list[NDArray[np.uint8]] | None = None
) -> None:
    """Write the recording, with a heatmap for every step, and a picture from outside where there are any."""
    from handsight.collection.sim.arm_shape import Ur10Shape
    from handsight.servoing.heatmap import grasp_heatmap
    from handsight.training.run import load_scorer
    from handsight.viz.recordings.servo_trace import write_servo_trace

    scorer = load_scorer(model)
    heatmaps = []
    with progress_bar("heatmaps", len(recording.trace.steps)) as bar:
        for step in recording.trace.steps:
            heatmaps.append(grasp_heatmap(step.view, scorer))
            bar.advance()
    write_servo_trace(out, recording, heatmaps, outside, Ur10Shape())
