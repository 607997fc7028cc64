"""What ``handsight ablate`` and ``handsight crossval`` share: their options, and the sweep itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from handsight.cli.errors import CommandError
from handsight.cli.opening import check_named_once, checked_address
from handsight.cli.options import MOST_EPOCHS
from handsight.cli.output import bold, console, print_json
from handsight.cli.wiring.engines import check_engine, engine_named
from handsight.datasets.address import location_of
from handsight.datasets.errors import counted

FAILED = 1
"""Exit status where cells failed."""
USUAL_TRIALS = 30

SweepOut = Annotated[
    Path,
    typer.Option(
        "--out", metavar="DIR", help="Folder of the sweep, or s3://bucket/prefix; the same call goes on in it."
    ),
]
Trials = Annotated[
    int, typer.Option("--trials", max=1000, help="How often groups are drawn anew and held out; more can follow later.")
]
By = Annotated[
    Literal["object", "scene", "session"], typer.Option("--by", help="What is never on both sides of a trial.")
]
HeldOut = Annotated[float, typer.Option("--held-out", help="Share of these that a trial holds out.")]
SweepViewpoint = Annotated[
    Literal["overhead", "pregrasp"], typer.Option("--viewpoint", help="Picture that is warped to the grasp.")
]
Epochs = Annotated[
    int, typer.Option(max=MOST_EPOCHS, help="Most passes over the data; there are fewer where more would not help.")
]
Balance = Annotated[
    bool,
    typer.Option(
        "--balance/--no-balance",
        help="Weigh successes and failures alike in training, as balanced test sets do; without, scores are chances.",
    ),
]
RetryFailed = Annotated[
    bool, typer.Option("--retry-failed", help="Go on with cells that failed, from where each of them stood.")
]
RestartFailed = Annotated[bool, typer.Option("--restart-failed", help="Begin anew with cells that failed.")]
Allow = Annotated[
    list[str] | None,
    typer.Option(
        "--allow",
        metavar="NAME",
        help="Part of the plan that may differ from that of the folder, such as handsight, its version; may be given "
        "several times.",
    ),
]


def sweep(
    datasets: list[str],
    out: Path,
    axes: dict[str, Any],
    *,
    recipe: dict[str, Any],
    only: list[str],
    retry_failed: bool,
    restart_failed: bool,
    allow: list[str],
    workers: int,
    engine: str,
    ray_address: str | None,
    dry_run: bool,
    as_json: bool,
) -> dict[str, Any] | None:
    """Plan and train a sweep; returns what it found, or None of a dry run, which says what it would do."""
    check_engine(engine, ray_address)
    location = location_of(out)
    check_named_once(datasets)
    for dataset in datasets:
        checked_address(dataset)
    from handsight.cli.wiring.sweeps import estimated, planned, print_estimate, run, write_tables
    from handsight.training.settings import TrainSettings
    from handsight.training.sweep.folder import SweepFolder
    from handsight.training.sweep.place import sweep_place
    from handsight.training.sweep.run import chosen_by

    place = sweep_place(location, begin=True)
    settings = TrainSettings(**recipe)
    plan = planned(datasets, place.folder, only=only, allowed=allow, dry_run=dry_run, recipe=settings, **axes)
    if dry_run:
        left = estimated(plan, SweepFolder(place.folder), chosen_by(only, plan), workers)
        if as_json:
            print_json({"plan": plan.to_json(), "left": left})
        else:
            print_estimate(plan, left, workers)
        return None
    with engine_named(engine, ray_address, workers) as started:
        report = run(
            plan,
            place,
            workers=workers,
            engine=started,
            only=only,
            retry_failed=retry_failed,
            restart_failed=restart_failed,
        )
    found = write_tables(plan, place)
    return {**found, "trained": report.trained, "elsewhere": report.elsewhere}


def end_sweep(found: dict[str, Any] | None, *, as_json: bool, objects: bool = False) -> None:
    """Print what a sweep found; exit status 1 where cells failed."""
    if found is None:
        return
    if as_json:
        print_json(found)
    else:
        from handsight.cli.wiring.sweeps import print_found, print_objects

        print_found(found)
        if objects:
            print_objects(found)
        states = found["states"]
        rest = "".join(f", {states[name]} {name}" for name in ("failed", "running", "left") if states[name])
        console.print(bold(found["out"]), f": {states['done']} of {counted(sum(states.values()), 'cell')} done{rest}")
        if states["failed"]:
            console.print("to train failed cells again: the same call with --retry-failed or --restart-failed")
    if found["states"]["failed"]:
        raise typer.Exit(FAILED)


def sizes_of(text: str) -> list[int | None]:
    """Sizes of training sets from ``250,500,all``.

    Raises:
        CommandError: Some are no numbers; all of them are named.
    """
    sizes: list[int | None] = []
    unknown = []
    for word in words_of(text):
        if word == "all":
            sizes.append(None)
        elif word.isascii() and word.isdecimal() and len(word) < 10:
            sizes.append(int(word))
        else:
            unknown.append(word)
    if unknown:
        raise CommandError(f"--sizes has {', '.join(map(repr, unknown))}, expected numbers of attempts, or all")
    return sizes


def words_of(text: str) -> list[str]:
    """What stands between commas."""
    return [word.strip() for word in text.split(",") if word.strip()]
