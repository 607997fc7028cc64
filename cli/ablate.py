"""``handsight ablate``: what a network reads against how much it learns from, cross-validated (figure 7)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from handsight.cli.completion import words
from handsight.cli.errors import CommandError
from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app
from handsight.cli.opening import check_named_once, checked_address
from handsight.cli.options import MOST_EPOCHS, Datasets, DryRun, EngineName, Json, RayAddress, Seed, Workers
from handsight.cli.output import bold, console, print_json
from handsight.cli.wiring.engines import check_engine, engine_named
from handsight.datasets.address import location_of
from handsight.datasets.errors import counted
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT

FAILED = 1
"""Exit status where cells failed."""
USUAL_TRIALS = 30

SweepOut = Annotated[
    Path,
    typer.Option(
        "--out", metavar="DIR", help="Folder of the sweep, or s3://bucket/prefix; the same call goes on in it."
    ),
]
SweepFolderArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a sweep, or s3://bucket/prefix.")]
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


class AblateGroup(LazyGroup):
    """The sweep itself, and what looks at one; a dataset in the place of a verb means the sweep."""

    table = (
        LazyCommand(
            "run",
            "ablate:ablate_run",
            "Train the cells of a sweep; the word 'run' can be left out.",
            (
                "handsight ablate run grasps@v1 --sizes 500,1000,2000 --out figure7 --dry-run",
                "handsight ablate run clean@v1 noisy@v1 --channels rgb,depth --out noise",
                "handsight ablate run grasps@v1 --sizes 2000 --vary mixup=0,0.2 --out mixup",
            ),
            kept="cells that are done are kept; the same call goes on",
        ),
        LazyCommand(
            "status",
            "ablate:ablate_status",
            "Say what is done and what is left.",
            ("handsight ablate status figure7",),
        ),
        LazyCommand(
            "plot",
            "ablate:ablate_plot",
            "Write the tables and the figure anew.",
            ("handsight ablate plot figure7",),
        ),
    )

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Let the sweep itself go without its verb."""
        verbs = {command.name for command in self.table}
        if args and args[0] not in verbs and args[0] not in ("-h", "--help"):
            args = ["run", *args]
        return super().parse_args(ctx, args)


ablate_app = lazy_app(AblateGroup, help="Compare what networks read, by how much they learn from (figure 7).")


def ablate_run(
    datasets: Datasets,
    out: SweepOut,
    channels: Annotated[
        str,
        typer.Option(
            metavar="A,B,C", help="What networks read: rgbd, rgb, depth.", autocompletion=words("rgbd", "rgb", "depth")
        ),
    ] = "rgb,depth,rgbd",
    sizes: Annotated[
        str,
        typer.Option(
            metavar="N,N,all",
            help="Attempts in training sets; unless given 250, 500, 1000, 2000, 5000 and so on up to what there is.",
        ),
    ] = "",
    trials: Trials = USUAL_TRIALS,
    by: By = "object",
    held_out: HeldOut = 0.2,
    seed: Seed = 0,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=A,B",
            help="Part of the recipe that is tried several ways: augmentation=on,off, balance, mixup, lr, average, "
            "batch, epochs or patience; may be given several times.",
        ),
    ] = None,
    epochs: Epochs = 40,
    balance: Balance = True,
    viewpoint: SweepViewpoint = DEFAULT_VIEWPOINT,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CHANNELS:SIZE:TRIAL",
            help="Only these cells: rgb, rgb:5000 or rgb:5000:3, or of one of several datasets 'rgb noisy@v1'; may be "
            "given several times.",
        ),
    ] = None,
    retry_failed: RetryFailed = False,
    restart_failed: RestartFailed = False,
    allow: Allow = None,
    workers: Workers = 2,
    engine: EngineName = "local",
    ray_address: RayAddress = None,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Train networks that read RGB, depth or both on training sets of several sizes, and test them on other objects.

    Every trial holds out other objects and tests all networks on the same. Datasets given beside each other, such as
    one with and one without noise, are compared too. The same call goes on where another was interrupted, several calls
    on one folder share the work, and more trials, sizes or channels can be asked for later.
    """
    axes = {
        "channels": _split(channels),
        "sizes": sizes_of(sizes),
        "varied": varied_of(vary or []),
        "trials": trials,
        "by": by,
        "held_out": held_out,
        "seed": seed,
        "viewpoint": viewpoint,
    }
    found = sweep(
        datasets,
        out,
        axes,
        recipe={"epochs": epochs, "balance": balance},
        only=only or [],
        retry_failed=retry_failed,
        restart_failed=restart_failed,
        allow=allow or [],
        workers=workers,
        engine=engine,
        ray_address=ray_address,
        dry_run=dry_run,
        as_json=as_json,
    )
    end_sweep(found, as_json=as_json)


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


def ablate_status(folder: SweepFolderArgument, workers: Workers = 2, as_json: Json = False) -> None:
    """Count the cells of a sweep by what they have come to, and say how long the rest will take."""
    from handsight.cli.wiring.sweeps import duration_text, size_text
    from handsight.training.sweep.estimate import estimate
    from handsight.training.sweep.folder import SweepFolder
    from handsight.training.sweep.place import sweep_place
    from handsight.training.sweep.plan import read_plan

    place = sweep_place(location_of(folder), begin=False)
    plan, cells = read_plan(place.folder), SweepFolder(place.folder)
    states = {cell: cells.state(cell) for cell in plan.cells()}
    done = cells.results(plan.cells())
    left = [cell for cell, state in states.items() if state in ("left", "running")]
    seconds = estimate(plan, left, done, workers=workers, speeds=None).seconds if done else None
    points: dict[tuple[str, int | None], list[str]] = {}
    for cell, state in states.items():
        points.setdefault((cell.series(plan.dataset_names), cell.size), []).append(state)
    names = ("done", "failed", "running", "left")
    counts = {point: [some.count(name) for name in names] for point, some in points.items()}
    if as_json:
        failed = [
            {"cell": cell.name, "why": cells.failure(cell)} for cell, state in states.items() if state == "failed"
        ]
        rows = [
            {"series": series, "size": size, **dict(zip(names, numbers, strict=True))}
            for (series, size), numbers in counts.items()
        ]
        print_json({"rows": rows, "failed": failed, "seconds_left": seconds})
        return
    from handsight.cli.tables import print_table

    print_table(
        ("series", "attempts", *names),
        [(series, size_text(size), *map(str, numbers)) for (series, size), numbers in counts.items()],
    )
    for cell, state in states.items():
        if state == "failed":
            console.print(f"{cell.name} failed: {cells.failure(cell)}")
    if left:
        time_left = "unknown, no cell is done" if seconds is None else f"about {duration_text(seconds)}"
        console.print(
            f"left to do: {len(left)} of {counted(len(states), 'cell')}, {time_left} on {counted(workers, 'worker')}"
        )


def ablate_plot(folder: SweepFolderArgument, as_json: Json = False) -> None:
    """Write the tables, the page and the figure of a sweep from the cells that are done."""
    from handsight.cli.wiring.sweeps import write_tables
    from handsight.training.sweep.place import sweep_place
    from handsight.training.sweep.plan import read_plan

    place = sweep_place(location_of(folder), begin=False)
    end_sweep(write_tables(read_plan(place.folder), place), as_json=as_json)


def sizes_of(text: str) -> list[int | None]:
    """Sizes of training sets from ``250,500,all``.

    Raises:
        CommandError: Some are no numbers; all of them are named.
    """
    sizes: list[int | None] = []
    unknown = []
    for word in _split(text):
        if word == "all":
            sizes.append(None)
        elif word.isascii() and word.isdecimal() and len(word) < 10:
            sizes.append(int(word))
        else:
            unknown.append(word)
    if unknown:
        raise CommandError(f"--sizes has {', '.join(map(repr, unknown))}, expected numbers of attempts, or all")
    return sizes


def varied_of(texts: list[str]) -> dict[str, list[str]]:
    """Axes from ``NAME=A,B``.

    Raises:
        CommandError: A text has another form, or a name comes twice.
    """
    varied: dict[str, list[str]] = {}
    for text in texts:
        name, sign, values = text.partition("=")
        if not sign or not name or name in varied:
            raise CommandError(f"--vary is {text!r}, expected NAME=A,B with every name once")
        varied[name] = _split(values)
    return varied


def _split(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]
