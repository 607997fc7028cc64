"""``handsight tune``: a better recipe looked for, each proposal judged on objects that its networks never saw."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from handsight.cli.errors import CommandError
from handsight.cli.opening import checked_address
from handsight.cli.options import Dataset, DryRun, EngineName, Json, RayAddress, Seed, Workers
from handsight.cli.output import print_json
from handsight.cli.sweep import By, Epochs, HeldOut, SweepViewpoint, sizes_of
from handsight.cli.wiring.engines import check_engine, engine_named
from handsight.datasets.address import location_of
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT

NOTHING_FOUND = 1
"""Exit status where no proposal could be judged."""


def tune_command(
    dataset: Dataset,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the search; the same call goes on in it.")
    ],
    proposals: Annotated[
        int, typer.Option(max=10_000, help="Recipes to try in all, the usual one first; more can follow later.")
    ] = 30,
    trials: Annotated[
        int, typer.Option(max=1000, help="How often groups are drawn anew and held out, for every proposal alike.")
    ] = 3,
    channels: Annotated[Literal["rgbd", "rgb", "depth"], typer.Option(help="What the network reads.")] = "rgbd",
    size: Annotated[
        str, typer.Option(metavar="N", help="Attempts to train on; all that are not held out unless given.")
    ] = "all",
    by: By = "object",
    held_out: HeldOut = 0.2,
    seed: Seed = 0,
    epochs: Epochs = 40,
    viewpoint: SweepViewpoint = DEFAULT_VIEWPOINT,
    workers: Workers = 2,
    engine: EngineName = "local",
    ray_address: RayAddress = None,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Look for a better recipe: learning rate, weight decay, mixup, batch, averaging and augmentation.

    Optuna proposes (pip install 'handsight[tune]'); every proposal is trained and tested on the same trials, whose
    objects its networks never saw, and judged by the mean loss. One that is worse than half of the others after some
    trials is given up. The same call goes on where another was interrupted, and several calls on one folder share the
    work. The best recipe is in best.json, all of them are in proposals.csv.
    """
    sizes = sizes_of(size)
    if len(sizes) != 1:
        raise CommandError(f"--size is {size!r}, expected one number of attempts, or all")
    if proposals < 1:
        raise CommandError(f"--proposals is {proposals}, expected at least 1, which is the usual recipe")
    check_engine(engine, ray_address)
    _check_folder(out)
    checked_address(dataset)
    from handsight.cli.wiring.searches import estimated, found, planned, print_estimate, print_found, run
    from handsight.training.settings import TrainSettings

    plan = planned(
        dataset,
        out,
        dry_run=dry_run,
        viewpoint=viewpoint,
        channels=[channels],
        sizes=sizes,
        trials=trials,
        by=by,
        held_out=held_out,
        seed=seed,
        varied={},
        # Test sets are balanced: a network that knows how rare successes are would pay in the loss for knowing it.
        recipe=TrainSettings(epochs=epochs, balance=True),
    )
    if dry_run:
        left = estimated(plan, out, proposals, workers)
        if as_json:
            print_json({"plan": plan.to_json(), "left": left})
        else:
            print_estimate(plan, left, workers)
        return
    with engine_named(engine, ray_address, workers) as started:
        rows = run(plan, out, proposals=proposals, workers=workers, engine=started)
    if as_json:
        print_json(found(rows, out))
    else:
        print_found(rows, out)
    if not any(row.state in ("done", "running") for row in rows):
        raise typer.Exit(NOTHING_FOUND)


def _check_folder(out: Path) -> None:
    """Refuse a bucket, before a folder of its name is made.

    Raises:
        CommandError: It is no folder of this machine.
    """
    location = location_of(out)
    if not isinstance(location, Path):
        raise CommandError(
            f"--out is {location}, expected a folder: the journal of a search is a file that grows, and a "
            "bucket has none; the dataset can lie in a bucket, and the folder can be copied to one"
        )
