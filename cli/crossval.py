"""``handsight crossval``: how good a recipe is on objects that its networks never saw."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from handsight.cli.options import Dataset, DryRun, EngineName, Json, RayAddress, Seed, Workers
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
)
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT


def crossval_command(
    dataset: Dataset,
    out: SweepOut,
    channels: Annotated[Literal["rgbd", "rgb", "depth"], typer.Option(help="What the network reads.")] = "rgbd",
    size: Annotated[
        str, typer.Option(metavar="N", help="Attempts to train on; all that are not held out unless given.")
    ] = "all",
    trials: Trials = USUAL_TRIALS,
    by: By = "object",
    held_out: HeldOut = 0.2,
    seed: Seed = 0,
    epochs: Epochs = 40,
    balance: Balance = True,
    viewpoint: SweepViewpoint = DEFAULT_VIEWPOINT,
    retry_failed: RetryFailed = False,
    restart_failed: RestartFailed = False,
    allow: Allow = None,
    workers: Workers = 2,
    engine: EngineName = "local",
    ray_address: RayAddress = None,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Train and test again and again, each time with other objects held out, and say how far the mean can be trusted.

    Test sets are balanced; no attempt and no object is on both sides. The same call goes on where another was
    interrupted, and more trials can be asked for later.
    """
    axes = {
        "channels": [channels],
        "sizes": sizes_of(size),
        "varied": {},
        "trials": trials,
        "by": by,
        "held_out": held_out,
        "seed": seed,
        "viewpoint": viewpoint,
    }
    found = sweep(
        [dataset],
        out,
        axes,
        recipe={"epochs": epochs, "balance": balance},
        only=[],
        retry_failed=retry_failed,
        restart_failed=restart_failed,
        allow=allow or [],
        workers=workers,
        engine=engine,
        ray_address=ray_address,
        dry_run=dry_run,
        as_json=as_json,
    )
    end_sweep(found, as_json=as_json, objects=True)
