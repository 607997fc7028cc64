"""Sweeps: how long a cell takes to begin, and how much of the processors' time is spent in cells."""

from __future__ import annotations

import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks import Figure
from benchmarks.floors.frames import rendered_attempts
from benchmarks.floors.million import header_of
from handsight.datasets import GraspDataset, GraspRepository, SessionWriter
from handsight.datasets.inputs.materialize import GraspInputs, materialize
from handsight.jobs.unordered import map_unordered
from handsight.training.settings import TrainSettings
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.estimate import estimate, measured_speeds
from handsight.training.sweep.folder import SweepFolder
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.prepare import plan_sweep
from handsight.training.sweep.run import run_sweep
from handsight.training.sweep.work import SweepContext, SweepContextFactory
from handsight.training.trainer import train

_SESSIONS, _ATTEMPTS = 5, 260
"""Of each session; a trial holds one of them out."""
_WIDTH, _HEIGHT = 160, 120
_LARGE = 30_000
"""Attempts of the dataset that a cell begins on."""
_WORKERS = 2
_GRID_SIZES, _GRID_TRIALS = (500, 1_000, 2_000, 5_000, 10_000, 20_000, 30_000), 30
_BEGUN = 3


def sweeping_figures() -> list[Figure]:
    """How cells begin, and a small sweep on two workers."""
    with tempfile.TemporaryDirectory(prefix="handsight-bench-") as folder:
        path = Path(folder)
        dataset = _recorded(path / "grasps")
        return [_efficiency(dataset, path / "sweep"), *_starts(dataset, path / "inputs.npy"), _night(dataset)]


def _recorded(path: Path) -> GraspDataset:
    repository = GraspRepository.create(path)
    for seed in range(_SESSIONS):
        header = header_of(seed, width=_WIDTH, height=_HEIGHT)
        writer = SessionWriter.begin(repository, header)
        for attempt in rendered_attempts(header, _ATTEMPTS, np.random.default_rng(seed)):
            writer.append(attempt)
        writer.commit()
        writer.seal()
    return GraspDataset.open(str(path))


def _plan(dataset: GraspDataset, *, sizes: tuple[int, ...], trials: int, recipe: TrainSettings) -> SweepPlan:
    return plan_sweep(
        {str(dataset.repository.path): dataset},
        viewpoint="overhead",
        channels=("rgb", "depth"),
        sizes=sizes,
        trials=trials,
        by="session",
        held_out=0.2,
        seed=0,
        varied={},
        recipe=recipe,
    )


def _efficiency(dataset: GraspDataset, folder: Path) -> Figure:
    """A sweep from asking for its workers to their end."""
    plan = _plan(dataset, sizes=(500, 1_000), trials=3, recipe=TrainSettings(balance=True))
    folder.mkdir()
    data = [materialize(dataset)]
    began = time.perf_counter()
    run_sweep(plan, SweepFolder(folder), workers=_WORKERS, data=data)
    wall_s = time.perf_counter() - began
    results = list(SweepFolder(folder).results(plan.cells()).values())
    return Figure(
        name="efficiency of a sweep",
        ours=sum(result.seconds for result in results) / (_WORKERS * wall_s),
        unit="of the workers' time",
        peers={
            "processor time of cells": sum(result.processor_s for result in results) / (_WORKERS * wall_s),
            "seconds": wall_s,
        },
        n=len(results),
        what=(
            f"Seconds of all cells, from the first batch to the last score, by those of {_WORKERS} workers from being "
            "asked for to their end: cells of 500 and 1,000 attempts, the shortest of a figure. On a busy machine "
            "work the peer is lower: the share of this time for which a processor was at a cell."
        ),
    )


def _night(dataset: GraspDataset) -> Figure:
    """How long the grid of figure 7 would take, as ``ablate --dry-run`` reckons."""
    plan = _plan(dataset, sizes=(500,), trials=1, recipe=TrainSettings(balance=True))
    plan = replace(plan, channels=("rgb", "depth", "rgbd"))
    speeds = measured_speeds(plan, [materialize(dataset)], _WORKERS)
    grid = replace(plan, sizes=_GRID_SIZES, trials=_GRID_TRIALS)
    found = estimate(grid, grid.cells(), {}, workers=_WORKERS, speeds=speeds)
    return Figure(
        name="grid of figure 7, reckoned",
        ours=found.seconds / 3600,
        unit="h",
        peers={f"{channels}, samples/s of a worker": speed for channels, speed in speeds.items()},
        n=found.cells,
        what=(
            f"{_GRID_TRIALS} trials of three channel sets and sizes from {_GRID_SIZES[0]} to {_GRID_SIZES[-1]:,} on "
            f"{_WORKERS} workers, {found.passes:.0f} passes a cell, by the speed of as many at once here and now."
        ),
    )


def _starts(dataset: GraspDataset, path: Path) -> list[Figure]:
    """From asking for a worker to the end of the first pass of a cell, and from the end of one cell to that."""
    plan = _plan(dataset, sizes=(50,), trials=_BEGUN, recipe=replace(TrainSettings(), epochs=1))
    inputs = np.lib.format.open_memmap(path, mode="w+", dtype=np.float16, shape=(_LARGE, 4, 64, 64))
    rows = materialize(dataset).attempts
    attempts = pd.concat([rows] * -(-_LARGE // len(rows))).iloc[:_LARGE]
    factory = SweepContextFactory(plan, (GraspInputs(inputs=inputs, attempts=attempts),))
    began, ended, used = time.perf_counter(), [0.0], [0.0]
    for _, processor_s in map_unordered(factory, _begin, plan.cells(), workers=1):
        used.append(processor_s.result())
        ended.append(time.perf_counter() - began)
    first, *others = np.diff(ended)
    first_used, *others_used = np.diff(used)
    what = (
        f"and one pass over 50 of {_LARGE:,} attempts, whose inputs are mapped. The peer is the processor time of it."
    )
    return [
        Figure(
            name="start of a cell, worker included",
            ours=first,
            unit="s",
            peers={"processor time": first_used},
            n=1,
            what=f"A process, its imports, its data, a division of them, {what}",
        ),
        Figure(
            name="start of a cell",
            ours=statistics.median(others),
            unit="s",
            peers={"processor time": statistics.median(others_used)},
            n=len(others),
            what=f"In a worker that has had another one: a division of the data, {what}",
        ),
    ]


def _begin(context: SweepContext, cell: Cell) -> float:
    """Train a cell as a sweep does, without testing it; returns the processor time of this process so far [s]."""
    rows = context.division(cell.dataset, cell.trial).trained_on(cell.size)
    train(context.data[cell.dataset], cell.settings(context.plan.recipe, 0), rows=rows)
    return time.process_time()
