"""``handsight evaluate``: success of servo methods, with n, 95 % intervals and paired comparisons."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from handsight.cli.completion import complete_object_sets, words
from handsight.cli.errors import CommandError
from handsight.cli.opening import check_folder, check_out_file, check_rig_option
from handsight.cli.options import (
    DEFAULT_GRIPPER,
    DEFAULT_THRESHOLD,
    DISTURBANCES,
    EVALUATION_SEED,
    METHOD_NAMES,
    MOST_TRIALS,
    NOVEL_OBJECTS,
    RIG_THRESHOLD,
    EngineName,
    Gripper,
    Json,
    Level,
    Live,
    LiveUrl,
    Model,
    RayAddress,
    TrialSeed,
    Workers,
)
from handsight.cli.output import errors, print_json
from handsight.cli.wiring.engines import check_engine, engine_named
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    from handsight.collection.ur10.station_factory import Ur10StationFactory


def evaluate_command(
    model: Model,
    methods: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,C", help="Servo methods; all there are unless given.", autocompletion=words(*METHOD_NAMES)
        ),
    ] = None,
    objects: Annotated[
        str,
        typer.Option(
            metavar="SET,SET",
            help="Object sets; see 'handsight objects ls'.",
            autocompletion=complete_object_sets,
        ),
    ] = NOVEL_OBJECTS,
    trials: Annotated[
        int, typer.Option("--trials", "-n", max=MOST_TRIALS, help="Trials of each method on each object set.")
    ] = 100,
    station: Annotated[Literal["sim", "ur10"], typer.Option(help="Where to try.")] = "sim",
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
    workers: Workers = 2,
    against: Annotated[
        str | None,
        typer.Option(
            metavar="METHOD",
            help="Compare with this method; unless given the best.",
            autocompletion=words(*METHOD_NAMES),
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE", help="Journal of the trials; the same call goes on with it after an interruption."
        ),
    ] = None,
    disturb: Annotated[
        str | None,
        typer.Option(
            metavar="KIND:SIZE",
            help="Disturb the station, and try methods with one look too: "
            f"{', '.join(DISTURBANCES[:-1])} or {DISTURBANCES[-1]}.",
            autocompletion=words(*DISTURBANCES),
        ),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw the trials by their number of servo moves (figure 9).")
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(
            "--figures",
            metavar="DIR",
            help="Draw everything into this folder as PNG and SVG: rates, the table, moves (figure 9), calibration.",
        ),
    ] = None,
    calibration: Annotated[bool, typer.Option("--calibration", help="Print success by predicted success.")] = False,
    causes: Annotated[bool, typer.Option("--causes", help="Print the failures by cause.")] = False,
    live: Live = False,
    live_url: LiveUrl = None,
    engine: EngineName = "local",
    ray_address: RayAddress = None,
    as_json: Json = False,
) -> None:
    """Compare servo methods on the same scenes and starting poses (section V-B.2)."""
    check_engine(engine, ray_address)
    check_finished_run(model)
    check_rig_option(station, rig)
    if rig is not None and disturb is not None:
        raise CommandError("--disturb is of the simulated station: no rig is disturbed on purpose")
    if out is not None:
        check_out_file(out)
    if figures is not None:
        check_folder("--figures", figures)
    from handsight.cli.wiring.live import check_live, live_watch

    check_live(live=live, url=live_url)
    from handsight.cli.wiring.evaluations import evaluate_model
    from handsight.evaluation.comparison import check_reference
    from handsight.evaluation.disturbance import Disturbance
    from handsight.evaluation.evaluate import EvaluationSettings, method_names
    from handsight.servoing.loop import ServoSettings
    from handsight.servoing.methods.registry import METHODS

    settings = EvaluationSettings(
        methods=tuple(METHODS if methods is None else method_names(methods)),
        trials=trials,
        seed=seed,
        workers=workers if rig is None else 1,
        servo=ServoSettings(threshold=_threshold(threshold, rig), level=level),
    )
    check_reference(against, settings.methods)
    disturbance = None if disturb is None else Disturbance.parse(disturb)
    if figure is not None:
        _check_figure(figure, settings.methods)
    with live_watch(live=live, url=live_url) as watch, engine_named(engine, ray_address, workers) as started:
        results = evaluate_model(
            model,
            objects,
            settings,
            gripper=gripper,
            out=out,
            against=against,
            disturbance=disturbance,
            rig=None if rig is None else _rig_station(rig),
            watch=watch,
            engine=started,
        )
    if figure is not None:
        from handsight.viz.figures.durations import durations_figure

        durations_figure(results["durations"], figure)
    if figures is not None:
        from handsight.viz.figures.evaluation import evaluation_figures

        evaluation_figures(results, figures, source="sim" if rig is None else "ur10")
    if as_json:
        print_json(results)
    else:
        _print(results, calibration=calibration, causes=causes)
    if results["fault"] is not None:
        errors.print(f"error: {results['fault']}")
        raise typer.Exit(1)


def _threshold(given: float | None, rig: Path | None) -> float:
    if given is not None:
        return given
    return DEFAULT_THRESHOLD if rig is None else RIG_THRESHOLD


def _rig_station(rig: Path) -> Ur10StationFactory:
    from handsight.cli.wiring.rigs import rig_station

    return rig_station(rig, rig.parent)


def _check_figure(figure: Path, methods: tuple[str, ...]) -> None:
    """Refuse a figure that could not be drawn, before there are trials to draw."""
    from handsight.servoing.methods.registry import METHODS
    from handsight.viz.figures.style import check_figure_path

    if all(METHODS[name].settings is None for name in methods):
        raise CommandError("--figure draws servo moves, and none of the methods servoes: name one with --methods")
    check_figure_path(figure, ".png")


def _print(results: dict[str, Any], *, calibration: bool, causes: bool) -> None:
    from handsight.cli.wiring import evaluation_tables as tables

    tables.print_results(results["rows"])
    tables.print_comparisons(results["comparisons"])
    if results["disturbance"] is not None:
        tables.print_one_look(results["one_look"], results["disturbance"])
    if calibration:
        tables.print_calibration(results["calibration"])
    if causes:
        tables.print_causes(results["causes"])
