"""``handsight collect``: stations write labelled attempts into a dataset."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from handsight.cli.completion import words
from handsight.cli.interrupts import INTERRUPTED
from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app
from handsight.cli.opening import check_out_file, check_rig_file, check_target
from handsight.cli.options import (
    DEFAULT_GRIPPER,
    DEFAULT_METHOD,
    DEFAULT_THRESHOLD,
    METHOD_NAMES,
    MOST_ATTEMPTS,
    RIG_THRESHOLD,
    TRAINING_OBJECTS,
    VARIED_KINDS,
    DatasetPath,
    EngineName,
    Gripper,
    Json,
    Level,
    Objects,
    PerScene,
    RayAddress,
    Renderer,
    RigFile,
    Seed,
    Workers,
)
from handsight.cli.output import bold, console, errors, print_json, progress_bar
from handsight.cli.wiring.engines import check_engine, engine_named
from handsight.cli.wiring.policies import DEFAULT_RANDOM_SHARE, policy_named
from handsight.datasets.errors import counted
from handsight.jobs.engine import LOCAL, Engine

if TYPE_CHECKING:
    # Icechunk and PyBullet take a second; nothing is imported for options that make no sense.
    from handsight.collection.collector import CollectReport, CollectSettings, StationFactory
    from handsight.datasets.records import GraspAttempt


class CollectGroup(LazyGroup):
    """Everything behind ``handsight collect``."""

    table = (
        LazyCommand(
            "sim",
            "collect:collect_sim",
            "Collect grasps in simulation.",
            (
                "handsight collect sim grasps -n 600 -w 4",
                "handsight collect sim grasps -n 600 --resume",
                "handsight collect sim more --policy servo --model runs/rgbd --vary all",
            ),
            kept="every finished attempt is committed; go on with --resume",
        ),
        LazyCommand(
            "ur10",
            "collect:collect_ur10",
            "Collect grasps with a real rig.",
            (
                "handsight collect ur10 grasps --rig rig.toml -n 20000",
                "handsight collect ur10 grasps --rig rig.toml -n 20000 --resume",
                "handsight collect ur10 more --rig rig.toml -n 500 --policy servo --model runs/rgbd",
            ),
            kept="every attempt that was told of is committed; go on with --resume",
        ),
        LazyCommand(
            "picture",
            "collect:collect_picture",
            "Draw the simulated station from outside.",
            ("handsight collect picture --out station.png --seed 3",),
        ),
    )


collect_app = lazy_app(CollectGroup, help="Collect grasp attempts into a dataset.")


Policy = Annotated[
    Literal["uniform", "servo"], typer.Option(help="Who chooses where to grasp: chance, or a trained network.")
]
PolicyModel = Annotated[Path | None, typer.Option(metavar="RUN", help="Network of the servo policy.")]
PolicyMethod = Annotated[
    str | None,
    typer.Option(
        help=f"Servo method of the servo policy; {DEFAULT_METHOD} unless given.",
        autocompletion=words(*METHOD_NAMES),
    ),
]
RandomShare = Annotated[
    float | None,
    typer.Option(help=f"Share of attempts left to chance by the servo policy; {DEFAULT_RANDOM_SHARE} unless given."),
]
PregraspPicture = Annotated[
    bool, typer.Option("--pregrasp-picture", help="Also record a picture at the pre-grasp pose.")
]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with an interrupted session.")]


def collect_sim(
    dataset: DatasetPath,
    attempts: Annotated[int, typer.Option("--attempts", "-n", max=MOST_ATTEMPTS, help="Length of the session.")] = 600,
    seed: Seed = 0,
    workers: Workers = 2,
    objects: Objects = TRAINING_OBJECTS,
    per_scene: PerScene = None,
    gripper: Gripper = DEFAULT_GRIPPER,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND",
            help="What differs between scenes beside the objects: table, light, colour, friction, depth-noise, or all; "
            "may be given several times.",
            autocompletion=words(*VARIED_KINDS),
        ),
    ] = None,
    policy: Policy = "uniform",
    model: PolicyModel = None,
    method: PolicyMethod = None,
    random_share: RandomShare = None,
    threshold: Annotated[
        float | None,
        typer.Option(help=f"Predicted success at which the servo policy grasps; {DEFAULT_THRESHOLD} unless given."),
    ] = None,
    level: Level = False,
    shakes: Annotated[int, typer.Option(min=0, max=100, help="Shakes after the lift; section III-B has three.")] = 0,
    pregrasp_picture: PregraspPicture = False,
    renderer: Renderer = "tiny",
    resume: Resume = False,
    engine: EngineName = "local",
    ray_address: RayAddress = None,
    as_json: Json = False,
) -> None:
    """Collect grasps in simulation, random ones (section V-B) or a network's own; creates a missing dataset.

    The same seed gives the same attempts, whatever the engine, the number of workers and the interruptions.
    """
    check_engine(engine, ray_address)
    check_target(dataset)
    chosen = policy_named(
        policy, model=model, method=method, random_share=random_share, threshold=threshold, level=level
    )
    from handsight.collection.collector import CollectSettings

    settings = CollectSettings(
        attempts=attempts, seed=seed, workers=workers, policy=chosen, pregrasp_picture=pregrasp_picture
    )
    from handsight.cli.wiring.renderers import with_renderer
    from handsight.cli.wiring.stations import randomized, sim_station

    factory = with_renderer(
        sim_station(objects, gripper=gripper, shakes=shakes, per_scene=per_scene, vary=randomized(vary)),
        renderer,
        dataset=dataset,
        seed=seed,
    )
    with engine_named(engine, ray_address, workers) as started:
        report = collect_with_progress(dataset, factory, settings, resume=resume, engine=started)
    _tell(report, dataset, as_json=as_json)


def collect_ur10(
    dataset: DatasetPath,
    rig: RigFile,
    attempts: Annotated[int, typer.Option("--attempts", "-n", max=MOST_ATTEMPTS, help="Length of the session.")] = 600,
    seed: Seed = 0,
    policy: Policy = "uniform",
    model: PolicyModel = None,
    method: PolicyMethod = None,
    random_share: RandomShare = None,
    threshold: Annotated[
        float | None,
        typer.Option(help=f"Predicted success at which the servo policy grasps; {RIG_THRESHOLD} unless given."),
    ] = None,
    level: Level = False,
    pregrasp_picture: PregraspPicture = False,
    resume: Resume = False,
    as_json: Json = False,
) -> None:
    """Collect grasps with a UR10, unattended (section V-C); creates a missing dataset.

    Every attempt is committed before the next one begins. The rig recovers by itself from what it may; where a person
    has to come it sounds the alarm of its file and ends with exit status 1, and --resume goes on.
    """
    check_rig_file(rig)
    check_target(dataset)
    if policy == "servo" and threshold is None:
        threshold = RIG_THRESHOLD
    chosen = policy_named(
        policy, model=model, method=method, random_share=random_share, threshold=threshold, level=level
    )
    from handsight.collection.collector import CollectSettings

    settings = CollectSettings(
        attempts=attempts, seed=seed, workers=1, policy=chosen, pregrasp_picture=pregrasp_picture
    )
    from handsight.cli.wiring.rigs import collect_with_rig, rig_station

    report = collect_with_rig(dataset, rig_station(rig, dataset), settings, resume=resume)
    _tell(report, dataset, as_json=as_json)
    if report.paused:
        errors.print(f"paused: {report.paused}")
        raise typer.Exit(1)


def _tell(report: CollectReport, dataset: str, *, as_json: bool) -> None:
    """What a session holds now."""
    if as_json:
        print_json(report)
        return
    added = report.attempts - report.resumed_from
    held = counted(report.attempts, "attempt")
    console.print(
        bold(dataset),
        f": session {report.session} holds {held}, {added} of them new, {report.successes} of these successful",
    )


def collect_picture(
    out: Annotated[Path, typer.Option("--out", help="Picture to write, a PNG file.")] = Path("station.png"),
    objects: Objects = TRAINING_OBJECTS,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Draw the whole simulated station from outside: arm, table and a scene of objects."""
    check_out_file(out, ".png")
    from handsight.cli.wiring.scene_pictures import write_station_picture  # PyBullet, once the options are sound

    write_station_picture(out, objects, seed)
    if as_json:
        print_json({"picture": out, "objects": objects, "seed": seed})
    else:
        console.print(bold(out), f": a scene of {objects} on the simulated station")


def collect_with_progress(
    dataset: str | Path,
    factory: StationFactory,
    settings: CollectSettings,
    *,
    resume: bool,
    engine: Engine = LOCAL,
) -> CollectReport:
    """Collect behind a progress bar; Ctrl-C keeps what is finished and says how to go on."""
    from handsight.collection.collector import collect
    from handsight.datasets.store.repository import GraspRepository

    repository = GraspRepository.open_or_create(dataset)
    done = successes = 0
    with progress_bar("collect", settings.attempts) as bar:

        def show(attempt: GraspAttempt, held: int) -> None:
            nonlocal done, successes
            done += 1
            successes += attempt.success
            bar.reached(held, f"{successes / done:.0%} successful")

        try:
            return collect(repository, factory, settings, resume=resume, engine=engine, on_attempt=show)
        except KeyboardInterrupt:
            sys.stderr.write(
                "interrupted: every finished attempt is committed; run it again to go on (collect: with --resume)\n"
            )
            raise typer.Exit(INTERRUPTED) from None
