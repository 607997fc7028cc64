"""One cell trained and tested, in a worker that has the data open."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from handsight.datasets.address import DatasetAddress
from handsight.datasets.curation.folds import attempt_groups
from handsight.datasets.inputs.materialize import GraspInputs, materialize
from handsight.datasets.reading.reader import GraspDataset
from handsight.servoing.homography import InputGrid
from handsight.training.errors import SweepPlanError
from handsight.training.metrics import evaluate_scores
from handsight.training.prediction import predict_with_flips
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.divisions import Division, divide, group_names
from handsight.training.sweep.plan import SweepDataset, SweepPlan
from handsight.training.sweep.result import CellResult, Prediction, object_scores
from handsight.training.trainer import train


@dataclass(frozen=True, slots=True, kw_only=True)
class CellTask:
    """A cell to train, and where it is kept meanwhile."""

    cell: Cell
    checkpoint: Path | None
    """None where the workers cannot see the folder of the sweep."""

    def __str__(self) -> str:
        return self.cell.name


@dataclass(frozen=True, slots=True)
class SweepContextFactory:
    """Opens the data of a plan in a worker; it is pickled to get there."""

    plan: SweepPlan
    data: tuple[GraspInputs, ...] | None = None
    """What whoever asks has open, for workers that see its files: a worker then maps them and opens no dataset."""

    def __call__(self) -> SweepContext:
        """Open the data; inputs that are not there yet are made."""
        # One thread for each cell: two cells at once are faster than one after the other on two threads.
        torch.set_num_threads(1)
        data = self.data or [materialized(dataset, self.plan) for dataset in self.plan.datasets]
        return SweepContext(self.plan, data)


class SweepContext:
    """A plan with its data.

    Args:
        plan: What is trained.
        data: Inputs of each of its datasets.
    """

    def __init__(self, plan: SweepPlan, data: Sequence[GraspInputs]) -> None:
        self.plan = plan
        self.data = data
        self._groups = group_names([one.attempts for one in data], plan.by)

    def close(self) -> None:
        """Nothing to let go of: inputs are mapped files."""

    def division(self, dataset: int, trial: int) -> Division:
        """What a trial holds out."""
        plan = self.plan
        rows = self.data[dataset].attempts
        return divide(rows, self._groups, by=plan.by, held_out=plan.held_out, seed=plan.seed, trial=trial)


def train_cell(context: SweepContext, task: CellTask, on_epoch: Callable[[Any], None] | None = None) -> CellResult:
    """Train the network of a cell and test it on what its trial holds out.

    Raises:
        TrainingError: It diverged, or its checkpoint cannot be used.
        OSError: The checkpoint cannot be written.
    """
    plan, cell = context.plan, task.cell
    data = context.data[cell.dataset]
    division = context.division(cell.dataset, cell.trial)
    settings = cell.settings(plan.recipe, plan.training_seed(cell.trial))
    began, began_processor = time.perf_counter(), time.process_time()
    trained = train(data, settings, rows=division.trained_on(cell.size), checkpoint=task.checkpoint, on_epoch=on_epoch)
    scores = predict_with_flips(trained.network, data.inputs, torch.from_numpy(division.test))
    labels = data.labels[division.test]
    predictions = _predictions(data.attempts.iloc[division.test], scores, plan)
    return CellResult(
        tested=evaluate_scores(scores, labels),
        predictions=predictions,
        objects=object_scores(predictions),
        curve=trained.history,
        epochs=len(trained.history),
        kept_epoch=trained.kept.number,
        trained_on=len(division.trained_on(cell.size)),
        held_out_attempts=division.held_out_attempts,
        pool=len(division.pool),
        seconds=time.perf_counter() - began,
        processor_s=time.process_time() - began_processor,
    )


def materialized(dataset: SweepDataset, plan: SweepPlan, on_attempt: Callable[[], None] | None = None) -> GraspInputs:
    """The inputs of a dataset of a plan.

    Raises:
        SweepPlanError: What is at the address is not what the plan was made of.
        DatasetError: It cannot be opened.
    """
    path = DatasetAddress.parse(dataset.address).path
    opened = GraspDataset.open(DatasetAddress(path=path, ref=dataset.snapshot))
    if opened.digest != dataset.digest:
        raise SweepPlanError(
            f"{dataset.address} at {dataset.snapshot} has digest {opened.digest}, expected {dataset.digest} as in the "
            "plan: it is another dataset"
        )
    grid = InputGrid(size_px=plan.recipe.network.size_px)
    return materialize(opened, viewpoint=dataset.viewpoint, grid=grid, on_attempt=on_attempt)


def _predictions(rows: pd.DataFrame, scores: NDArray[np.float32], plan: SweepPlan) -> tuple[Prediction, ...]:
    """What was said of each row of a test set."""
    told = zip(rows.index, attempt_groups(rows, plan.by), rows["success"], scores, strict=True)
    return tuple(
        Prediction(attempt=attempt, group=str(group), success=bool(success), score=float(score))
        for attempt, group, success, score in told
    )
