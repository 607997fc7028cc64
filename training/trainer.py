"""Training a Grasp Quality Network (section V-A)."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from handsight.datasets.errors import counted
from handsight.datasets.inputs.mixture import LabelledInputs
from handsight.datasets.inputs.twins import grasp_keys
from handsight.training.checkpoint import Checkpoint, identity_of
from handsight.training.course import Course, Epoch
from handsight.training.errors import DivergedError, TrainingDataError
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.metrics import evaluate_scores
from handsight.training.passes import CPU, Passes
from handsight.training.prediction import predict
from handsight.training.settings import TrainSettings

_GLOBAL_GENERATOR = threading.Lock()
"""Torch's global generator is one for all threads: a training that begins in another one would draw from our seed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trained:
    """A network, and how it came about."""

    network: GraspQualityNetwork
    history: tuple[Epoch, ...]
    """All passes, those after the one that is kept included."""
    kept: Epoch
    """The pass after which the network was kept: from ``least_epochs`` on that with the lowest held-out loss."""


def train(
    data: LabelledInputs,
    settings: TrainSettings,
    *,
    rows: NDArray[np.int64] | None = None,
    on_epoch: Callable[[Epoch], None] | None = None,
    checkpoint: Path | None = None,
    device: torch.device = CPU,
) -> Trained:
    """Train on ``data``; the same data, settings and number of threads give the same weights on one kind of processor.

    Inputs of one attempt, such as those of its two pictures, are held out together, and so are attempts at one grasp,
    such as those recorded with and without noise.

    Args:
        data: Inputs and labels.
        settings: The recipe.
        rows: Positions of the inputs to use, as if there were no others; None uses all. Shape (M,).
        on_epoch: Called after every pass; after those that a checkpoint has, too.
        checkpoint: File that the training goes on from, if it is there, and that it is kept in after every pass. It
            stays: once the network is stored, it is for the caller to delete.
        device: Where the network is trained.

    Raises:
        TrainingDataError: One class is missing, so there is nothing to tell apart.
        DivergedError: The loss of a pass is no number.
        CheckpointError: The checkpoint is damaged, or of another training.
        OSError: The checkpoint cannot be read or written.
    """
    labels = data.labels
    used = np.arange(len(labels)) if rows is None else rows
    _check_labels(labels[used])
    # Which attempts are held out and how inputs are jittered follows from this generator, the order of the batches from
    # the loader's; torch draws the initial weights from its global one, which is afterwards as it was.
    generator = torch.Generator().manual_seed(settings.seed)
    with _GLOBAL_GENERATOR, torch.random.fork_rng(devices=()):
        torch.manual_seed(settings.seed)
        network = GraspQualityNetwork(settings.network)
    held_out, trained_on = split_held_out(grasp_keys(data.attempts), used, settings.holdout, generator)

    passes = Passes(network, data, trained_on, settings, generator, device=device)
    course = Course(history=[], kept=0, weights=copy.deepcopy(passes.mean.state_dict()))
    kept_in = None
    if checkpoint is not None:
        kept_in = Checkpoint(path=checkpoint, identity=identity_of(data, used, settings, device))
        kept_in.read_into(course, passes)
    if on_epoch is not None:
        for epoch in course.history:
            on_epoch(epoch)
    while not _is_over(course, settings):
        epoch = _one_more(passes, data, held_out, number=len(course.history) + 1, settings=settings)
        course.history.append(epoch)
        loss = epoch.held_out.loss
        if epoch.number <= settings.least_epochs or loss is None or loss < _loss(course.history[course.kept]):
            course.kept, course.weights = epoch.number - 1, copy.deepcopy(passes.mean.state_dict())
        if kept_in is not None:
            kept_in.write(course, passes)
        if on_epoch is not None:
            on_epoch(epoch)
    network.load_state_dict(course.weights)
    return Trained(network=network.eval(), history=tuple(course.history), kept=course.history[course.kept])


def _one_more(
    passes: Passes, data: LabelledInputs, held_out: NDArray[np.int64], *, number: int, settings: TrainSettings
) -> Epoch:
    """A pass, and how good the network is after it."""
    train_loss = passes.run_one()
    _check_loss(train_loss, number, settings)
    scores = predict(passes.mean, data.inputs, torch.from_numpy(held_out))
    return Epoch(number=number, train_loss=train_loss, held_out=evaluate_scores(scores, data.labels[held_out]))


def _is_over(course: Course, settings: TrainSettings) -> bool:
    passes = len(course.history)
    return passes == settings.epochs or passes - 1 - course.kept >= settings.patience


def split_held_out(
    keys: pd.Index[str], used: NDArray[np.int64], share: float, generator: torch.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Divide positions into those held out and the others, no key into both.

    Args:
        keys: What the inputs that stay together share: their grasp, or their attempt. Shape (N,).
        used: Positions to divide. Shape (M,).
        share: How many of the keys are held out.
        generator: At the seed of the training, before anything else was drawn from it.

    Returns:
        Shapes (H,), (T,).
    """
    key_of_row, names = pd.factorize(keys[used])
    drawn = torch.randperm(len(names), generator=generator)[: int(share * len(names))].numpy()
    is_held_out = np.isin(key_of_row, drawn)
    return used[is_held_out], used[~is_held_out]


def _loss(epoch: Epoch) -> float:
    return math.inf if epoch.held_out.loss is None else epoch.held_out.loss


def _check_labels(labels: NDArray[np.float32]) -> None:
    positives = int(labels.sum())
    if positives in (0, len(labels)):
        raise TrainingDataError(
            f"{positives} of {counted(len(labels), 'attempt')} are successes, expected some of both: collect more"
        )


def _check_loss(loss: float, epoch: int, settings: TrainSettings) -> None:
    if not math.isfinite(loss):
        raise DivergedError(
            f"the loss is {loss} in epoch {epoch}, expected a number: lower the learning rate, which is "
            f"{settings.learning_rate}, or look for damage in the dataset, see 'handsight dataset verify --help'"
        )
