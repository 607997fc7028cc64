"""How long a sweep will take on this machine."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import torch

from handsight.datasets.inputs.augmentation import FLIPS
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.passes import Passes
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.result import CellResult
from handsight.training.sweep.work import SweepContext

ASSUMED_PASSES = 14
"""Of a cell, as long as none is done: training ends by held-out loss."""
_BATCHES = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What is left to do."""

    cells: int
    samples: float
    samples_per_s: float
    """Of one worker."""
    passes: float
    """Of a cell, measured or assumed."""
    seconds: float
    """With the workers that were asked for."""


def measured_speed(context: SweepContext) -> float:
    """Samples that one thread trains on in a second, on some batches of the first cell."""
    plan = context.plan
    cell = next(plan.cells())
    settings = cell.settings(plan.recipe, 0)
    rows = context.division(cell.dataset, cell.trial).pool[: max(2, settings.batch * _BATCHES // FLIPS)]
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        network = GraspQualityNetwork(settings.network)
        passes = Passes(network, context.data[cell.dataset], rows, settings, torch.Generator().manual_seed(0))
        passes.run_one()  # with all that is done once
        began = time.perf_counter()
        passes.run_one()
        return FLIPS * len(rows) / (time.perf_counter() - began)
    finally:
        torch.set_num_threads(threads)


def estimate(
    plan: SweepPlan, left: Iterable[Cell], done: Mapping[Cell, CellResult], *, workers: int, samples_per_s: float | None
) -> Estimate:
    """The time that some cells will take, by those that are done and else by the speed measured now.

    Args:
        plan: What is trained.
        left: Cells to do.
        done: Cells that are done.
        workers: How many are trained at once.
        samples_per_s: As measured; None to go by those that are done alone, of which there is one then.
    """
    # Each pass sees the attempts that are not held out within the training set.
    learnt = FLIPS * (1 - plan.recipe.holdout)
    passes = float(np.mean([result.epochs for result in done.values()])) if done else ASSUMED_PASSES
    if samples_per_s is None:
        samples = sum(learnt * result.trained_on * passes for result in done.values())
        samples_per_s = samples / sum(result.processor_s for result in done.values())
    cells = list(left)
    largest = max((one.attempts for one in plan.datasets), default=0) * (1 - plan.held_out)
    samples = sum(learnt * passes * (largest if cell.size is None else cell.size) for cell in cells)
    return Estimate(
        cells=len(cells),
        samples=samples,
        samples_per_s=samples_per_s,
        passes=passes,
        seconds=samples / samples_per_s / max(1, min(workers, len(cells))),
    )
