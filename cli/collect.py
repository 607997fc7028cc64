"""``handsight collect``: stations write labelled attempts into a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.options import DatasetPath, Json, Objects, Seed, Workers
from handsight.cli.output import console, errors, print_json, progress_bar
from handsight.cli.stations import sim_station
from handsight.collection.collector import CollectReport, CollectSettings, SeededStationFactory, collect
from handsight.datasets import GraspRepository
from handsight.datasets.records import GraspAttempt

collect_app = typer.Typer(help="Collect grasp attempts into a dataset.", no_args_is_help=True)

DEFAULT_OBJECTS = "household-train"


@collect_app.command("sim")
def collect_sim(
    dataset: DatasetPath,
    attempts: Annotated[int, typer.Option("--attempts", "-n", help="Length of the session.")] = 600,
    seed: Seed = 0,
    workers: Workers = 2,
    objects: Objects = DEFAULT_OBJECTS,
    shakes: Annotated[int, typer.Option(help="Shakes after the lift; section III-B has three.")] = 0,
    pregrasp_picture: Annotated[
        bool, typer.Option("--pregrasp-picture", help="Also record a picture at the pre-grasp pose.")
    ] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with an interrupted session.")] = False,
    as_json: Json = False,
) -> None:
    """Collect random grasps in simulation (section V-B); creates a missing dataset.

    The same seed gives the same attempts, whatever the number of workers and however often it was interrupted.
    """
    settings = CollectSettings(attempts=attempts, seed=seed, workers=workers, pregrasp_picture=pregrasp_picture)
    report = collect_with_progress(dataset, sim_station(objects, shakes=shakes), settings, resume=resume)
    if as_json:
        print_json(report)
    else:
        added = report.attempts - report.resumed_from
        console.print(
            f"[bold]{dataset}[/]: session {report.session} holds {report.attempts} attempts, {added} of them new, "
            f"{report.successes} of these successful"
        )


def collect_with_progress(
    dataset: str | Path, factory: SeededStationFactory, settings: CollectSettings, *, resume: bool
) -> CollectReport:
    """Collect behind a progress bar; Ctrl-C keeps what is finished and says how to go on."""
    repository = GraspRepository.open_or_create(dataset)
    done = successes = 0
    with progress_bar("collect", settings.attempts) as bar:

        def show(attempt: GraspAttempt, held: int) -> None:
            nonlocal done, successes
            done += 1
            successes += attempt.labelled and bool(attempt.outcome)
            bar.reached(held, f"{successes / done:.0%} successful")

        try:
            return collect(repository, factory, settings, resume=resume, on_attempt=show)
        except KeyboardInterrupt:
            errors.print(
                "interrupted: every finished attempt is committed; run it again to go on (collect: with --resume)"
            )
            raise typer.Exit(130) from None
