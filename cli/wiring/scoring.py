"""What ``handsight dataset score`` computes, behind progress bars."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from handsight.cli.output import progress_bar
from handsight.cli.wiring.label_review import cross_validated_scores
from handsight.datasets.inputs.materialize import GraspInputs, materialize, usable_attempts
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT
from handsight.datasets.reading.reader import GraspDataset
from handsight.evaluation.label_review import plan_review
from handsight.servoing.homography import InputGrid
from handsight.training.prediction import predict
from handsight.training.run import load_run

Scores = tuple[str, "pd.Series[float]"]
"""What made the scores, and the scores by id."""


def scores_by_run(dataset: GraspDataset, model: Path) -> Scores:
    """Scores of all attempts that can be trained on, by a trained run."""
    run = load_run(model)
    data = _materialized(dataset, run.grid)
    values = predict(run.network, data.inputs, torch.arange(len(data.attempts)))
    return f"weights {run.weights_sha256}", _by_id(data, values)


def scores_by_folds(dataset: GraspDataset, folds: str, *, epochs: int) -> Scores:
    """The same by networks that never saw what they score, one for each of the stored folds."""
    plan = plan_review(dataset, folds=folds, epochs=epochs, where="", seed=0)
    data = _materialized(dataset, InputGrid(size_px=plan.settings.network.size_px))
    return f"out of folds {folds!r}, {epochs} passes", _by_id(data, cross_validated_scores(data, plan))


def _materialized(dataset: GraspDataset, grid: InputGrid) -> GraspInputs:
    with progress_bar("warp", len(usable_attempts(dataset, DEFAULT_VIEWPOINT))) as bar:
        return materialize(dataset, viewpoint=DEFAULT_VIEWPOINT, grid=grid, on_attempt=bar.advance)


def _by_id(data: GraspInputs, values: NDArray[np.float32]) -> pd.Series[float]:
    return pd.Series(values.astype(np.float64), index=data.attempts.index)
