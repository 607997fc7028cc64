"""Cross-validated predictions: every attempt is scored by a network that never saw it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from handsight.datasets.errors import counted
from handsight.datasets.inputs.mixture import LabelledInputs
from handsight.training.course import Epoch
from handsight.training.errors import TrainingDataError
from handsight.training.metrics import Metrics, evaluate_scores
from handsight.training.prediction import predict_with_flips
from handsight.training.settings import TrainSettings
from handsight.training.trainer import train

_FAULTS_LISTED = 5


def out_of_fold_scores(
    data: LabelledInputs,
    fold_of_attempt: NDArray[np.integer[Any]],
    settings: TrainSettings,
    *,
    on_fold: Callable[[int, Metrics], None] | None = None,
    on_epoch: Callable[[Epoch], None] | None = None,
) -> NDArray[np.float32]:
    """Predicted success of every attempt, by the network that was trained on all folds but its own.

    No label has a part in the scores of its own fold. Every network starts from the same seed, so the scores follow
    from the division, not from the numbers of its folds. Each is the mean over the flips of the input, which
    tells successes from failures a little better than one of them.

    Args:
        data: Inputs and labels.
        fold_of_attempt: Fold of each attempt, in the order of ``data``; any whole numbers. Shape (N,).
        settings: The recipe. Nothing is held out but the fold, so its ``holdout`` does not count.
        on_fold: Called after each fold, in ascending order, with its number and the quality of its scores.
        on_epoch: Called after every pass of every network.

    Returns:
        Scores in [0, 1]. Shape (N,).

    Raises:
        TrainingDataError: The folds do not fit the data, there is only one, or one lacks successes or failures.
    """
    check_folds(data.labels, fold_of_attempt)
    recipe = replace(settings, holdout=0.0)
    scores = np.empty(len(fold_of_attempt), np.float32)
    for fold in np.unique(fold_of_attempt).tolist():
        others = np.flatnonzero(fold_of_attempt != fold)
        held_out = np.flatnonzero(fold_of_attempt == fold)
        network = train(data, recipe, rows=others, on_epoch=on_epoch).network
        scores[held_out] = predict_with_flips(network, data.inputs, torch.from_numpy(held_out))
        if on_fold is not None:
            on_fold(fold, evaluate_scores(scores[held_out], data.labels[held_out]))
    return scores


def check_folds(labels: NDArray[np.float32], fold_of_attempt: NDArray[Any]) -> None:
    """Refuse a division that cannot be cross-validated; every fault is in the message.

    Args:
        labels: 1 where the grasp succeeded. Shape (N,).
        fold_of_attempt: Fold of each attempt. Shape (N,).

    Raises:
        TrainingDataError: As for :func:`out_of_fold_scores`.
    """
    if fold_of_attempt.shape != labels.shape or not np.issubdtype(fold_of_attempt.dtype, np.integer):
        raise TrainingDataError(
            f"folds are {fold_of_attempt.dtype} of shape {fold_of_attempt.shape}, expected a whole number for each of "
            f"{counted(len(labels), 'attempt')}"
        )
    folds = np.unique(fold_of_attempt)
    faults = [] if len(folds) > 1 else [f"{counted(len(folds), 'fold')} given, expected at least 2"]
    for fold in folds.tolist():
        own = labels[fold_of_attempt == fold]
        if own.min() == own.max():
            faults.append(
                f"fold {fold} has {counted(int(own.sum()), 'success', 'successes')} in "
                f"{counted(len(own), 'attempt')}, expected some of both"
            )
    if faults:
        more = f"; and {len(faults) - _FAULTS_LISTED} more" if len(faults) > _FAULTS_LISTED else ""
        raise TrainingDataError(
            f"the folds cannot be cross-validated: {'; '.join(faults[:_FAULTS_LISTED])}{more}: "
            "use fewer folds, or collect more attempts"
        )
