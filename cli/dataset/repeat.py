"""``handsight dataset repeat``: recorded grasps performed again, a little beside where they were."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from handsight.cli.opening import checked_address, open_version
from handsight.cli.options import LARGEST_SEED, MOST_ATTEMPTS, Dataset, Json, Where, Workers
from handsight.cli.output import print_json


def repeat(
    dataset: Dataset,
    count: Annotated[
        int, typer.Option("--count", "-n", min=1, max=MOST_ATTEMPTS, help="Attempts, half of them successes.")
    ] = 100,
    repeats: Annotated[int, typer.Option(max=MOST_ATTEMPTS, help="Times that each is performed again.")] = 4,
    shift_mm: Annotated[
        float, typer.Option("--shift-mm", help="How far beside, along each axis: standard deviation.")
    ] = 1.0,
    turn_deg: Annotated[float, typer.Option("--turn-deg", help="How far turned: standard deviation.")] = 1.0,
    where: Where = "",
    seed: Annotated[int, typer.Option("--seed", max=LARGEST_SEED, help="Everything random follows from it.")] = 0,
    workers: Workers = 2,
    as_json: Json = False,
) -> None:
    """Perform simulated attempts again, a little beside where they were: what their labels hang on.

    Where a label changes with a millimetre, no network can be blamed for not foreseeing it. Where it stays, and scores
    that are stored in the dataset tell less, there is more to learn. With both distances at 0 every attempt ends as it
    did. Nothing in the dataset changes.
    """
    checked_address(dataset)
    from handsight.evaluation.repeatability import RepeatSettings

    settings = RepeatSettings(
        repeats=repeats, shift_m=shift_mm / 1e3, turn_rad=math.radians(turn_deg), seed=seed, workers=workers
    )
    opened = open_version(dataset)
    from handsight.cli.wiring.repeats import print_repeats, recorded_grasps, repeat_recorded

    results = repeat_recorded(opened, recorded_grasps(opened, count, where=where, seed=seed), settings)
    if as_json:
        print_json(results)
    else:
        print_repeats(results)
