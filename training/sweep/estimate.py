"""How long a sweep will take on this machine."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from handsight.datasets.inputs.augmentation import FLIPS
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.jobs.unordered import map_unordered
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.passes import Passes
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.result import CellResult
from handsight.training.sweep.work import SweepContext, SweepContextFactory

ASSUMED_PASSES = 19
"""Of a cell, as long as none is done: training ends by held-out loss. Mean over 115 cells of figure 7, by samples; a
recipe that ends sooner is believed."""
_BATCHES = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What is left to do."""

    cells: int
    samples: float
    samples_per_s: float
    """Of one worker, over all that is left."""
    passes: float
    """Mean of the cells, measured or assumed."""
    seconds: float
    """With the workers that were asked for."""


def measured_speeds(plan: SweepPlan, data: Sequence[GraspInputs], workers: int) -> dict[str, float]:
    """Samples that a worker trains on in a second, by what it reads, while as many are at work as there will be.

    Each trains on some batches of the first trial.
    """
    tasks = [channels for channels in plan.channels for _ in range(workers)]
    opener = SweepContextFactory(plan, tuple(data))
    found: dict[str, list[float]] = {channels: [] for channels in plan.channels}
    for channels, rate in map_unordered(opener, _speed, tasks, workers=workers, noun="measurement of"):
        found[channels].append(rate.result())
    return {channels: statistics.median(rates) for channels, rates in found.items()}


def _speed(context: SweepContext, channels: str) -> float:
    plan = context.plan
    cell = replace(next(plan.cells()), channels=channels)
    settings = cell.settings(plan.recipe, 0)
    rows = context.division(cell.dataset, cell.trial).pool[: max(2, settings.batch * _BATCHES // FLIPS)]
    network = GraspQualityNetwork(settings.network)
    passes = Passes(network, context.data[cell.dataset], rows, settings, torch.Generator().manual_seed(0))
    passes.run_one()  # with all that is done once
    began = time.perf_counter()
    passes.run_one()
    return FLIPS * len(rows) / (time.perf_counter() - began)


def estimate(
    plan: SweepPlan,
    left: Iterable[Cell],
    done: Mapping[Cell, CellResult],
    *,
    workers: int,
    speeds: Mapping[str, float] | None,
) -> Estimate:
    """The time that some cells will take, by those that are done and else by the speeds measured now.

    Args:
        plan: What is trained.
        left: Cells to do.
        done: Cells that are done.
        workers: How many are trained at once.
        speeds: As measured; None to go by those that are done alone, of which there is one then.
    """
    # Each pass sees the attempts that are not held out within the training set.
    learnt = FLIPS * (1 - plan.recipe.holdout)
    usual = float(np.mean([result.epochs for result in done.values()])) if done else ASSUMED_PASSES
    if speeds is None:
        speeds = _speeds_of(plan, done, learnt)
    cells = list(left)
    passes = [min(usual, cell.settings(plan.recipe, 0).epochs) for cell in cells]
    largest = max((one.attempts for one in plan.datasets), default=0) * (1 - plan.held_out)
    sizes = [largest if cell.size is None else cell.size for cell in cells]
    samples = [learnt * often * size for often, size in zip(passes, sizes, strict=True)]
    processor_s = sum(some / speeds[cell.channels] for some, cell in zip(samples, cells, strict=True))
    return Estimate(
        cells=len(cells),
        samples=sum(samples),
        samples_per_s=sum(samples) / processor_s if cells else statistics.mean(speeds.values()),
        passes=float(np.mean(passes)) if cells else usual,
        seconds=processor_s / max(1, min(workers, len(cells))),
    )


def _speeds_of(plan: SweepPlan, done: Mapping[Cell, CellResult], learnt: float) -> dict[str, float]:
    """Of cells that are done, by what they read; what none of them reads goes by all of them."""

    def rate(some: Sequence[CellResult]) -> float:
        return sum(learnt * one.epochs * one.trained_on for one in some) / sum(one.processor_s for one in some)

    by_channels = {name: [one for cell, one in done.items() if cell.channels == name] for name in plan.channels}
    return {name: rate(some or list(done.values())) for name, some in by_channels.items()}
