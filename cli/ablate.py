"""``handsight ablate``: what a network reads against how much it learns from, cross-validated (figure 7)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from handsight.cli.completion import words
from handsight.cli.errors import CommandError
from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app
from handsight.cli.options import Datasets, DryRun, EngineName, Json, RayAddress, Seed, Workers
from handsight.cli.output import print_json
from handsight.cli.sweep import (
    USUAL_TRIALS,
    Allow,
    Balance,
    By,
    Epochs,
    HeldOut,
    RestartFailed,
    RetryFailed,
    SweepOut,
    SweepViewpoint,
    Trials,
    end_sweep,
    sizes_of,
    sweep,
    words_of,
)
from handsight.datasets.address import location_of
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT

SweepFolderArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a sweep, or s3://bucket/prefix.")]


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
        "channels": words_of(channels),
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


def ablate_status(folder: SweepFolderArgument, workers: Workers = 2, as_json: Json = False) -> None:
    """Count the cells of a sweep by what they have come to, and say how long the rest will take."""
    from handsight.cli.wiring.sweep_status import print_status, sweep_status
    from handsight.training.sweep.place import sweep_place

    found = sweep_status(sweep_place(location_of(folder), begin=False), workers=workers)
    if as_json:
        print_json(found.to_json())
    else:
        print_status(found)


def ablate_plot(folder: SweepFolderArgument, as_json: Json = False) -> None:
    """Write the tables, the page and the figure of a sweep from the cells that are done."""
    from handsight.cli.wiring.sweeps import write_tables
    from handsight.training.sweep.place import sweep_place
    from handsight.training.sweep.plan import read_plan

    place = sweep_place(location_of(folder), begin=False)
    end_sweep(write_tables(read_plan(place.folder), place), as_json=as_json)


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
        varied[name] = words_of(values)
    return varied
