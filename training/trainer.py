"""Training a Grasp Quality Network (section V-A)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from handsight.datasets.errors import counted
from handsight.datasets.inputs.augmentation import FLIPS, Jitter, flipped
from handsight.datasets.inputs.loader import GraspLoader
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.datasets.inputs.torch_dataset import FlippedGrasps
from handsight.servoing.scores import check_scores
from handsight.training.errors import DivergedError, TrainerSettingsError, TrainingDataError
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.metrics import Metrics, evaluate_scores

SCORE_BATCH = 512


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainSettings:
    """The whole recipe."""

    network: GqnConfig = field(default_factory=GqnConfig)
    epochs: int = 20
    """Passes over the data; in each, every attempt is seen in all four flips."""
    batch: int = 200
    learning_rate: float = 2e-3
    """Peak of a one-cycle schedule."""
    weight_decay: float = 0.01
    balance: bool = False
    """Weigh the rarer successes so that both classes count alike. Without, S is the chance that the grasp succeeds,
    which is what the servo loop's threshold is compared with."""
    holdout: float = 0.1
    """Share of the attempts held out to report accuracy on."""
    jitter: Jitter = field(default_factory=Jitter)
    seed: int = 0

    def __post_init__(self) -> None:
        faults = []
        if self.epochs < 1 or self.batch < 2:
            faults.append(
                f"{counted(self.epochs, 'epoch')} at batch {self.batch}, expected at least 1 epoch and 2 in a batch"
            )
        if not (0 < self.learning_rate < 1 and 0 <= self.weight_decay < 1):
            faults.append(
                f"learning rate is {self.learning_rate}, weight decay {self.weight_decay}, expected in (0, 1), [0, 1)"
            )
        if not 0 <= self.holdout < 1:
            faults.append(f"holdout is {self.holdout}, expected in [0, 1)")
        if faults:
            raise TrainerSettingsError("; ".join(faults))


@dataclass(frozen=True, slots=True, kw_only=True)
class Epoch:
    """Progress after one pass."""

    number: int
    """From 1."""
    train_loss: float
    held_out: Metrics


def train(
    data: GraspInputs,
    settings: TrainSettings,
    *,
    rows: NDArray[np.int64] | None = None,
    on_epoch: Callable[[Epoch], None] | None = None,
) -> tuple[GraspQualityNetwork, tuple[Epoch, ...]]:
    """Train on ``data``; the same data, settings and number of threads give the same weights.

    Args:
        data: Inputs and labels.
        settings: The recipe.
        rows: Positions of the attempts to use, as if there were no others; None uses all. Shape (M,).
        on_epoch: Called after every pass.

    Raises:
        TrainingDataError: One class is missing, so there is nothing to tell apart.
        DivergedError: The loss of a pass is no number.
    """
    labels = data.labels
    used = np.arange(len(labels)) if rows is None else rows
    _check_labels(labels[used])
    # Which attempts are held out and how inputs are jittered follows from this generator, the order of the batches from
    # the loader's; torch draws the initial weights from its global one, which is afterwards as it was.
    generator = torch.Generator().manual_seed(settings.seed)
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(settings.seed)
        network = GraspQualityNetwork(settings.network)
    shuffled = used[torch.randperm(len(used), generator=generator).numpy()]
    held_out, trained_on = np.split(shuffled, [int(settings.holdout * len(used))])

    passes = _Passes(network, data, trained_on, settings, generator)
    history = []
    for number in range(1, settings.epochs + 1):
        train_loss = passes.run_one()
        _check_loss(train_loss, number, settings)
        metrics = evaluate_scores(predict(network, data.inputs, torch.from_numpy(held_out)), labels[held_out])
        history.append(Epoch(number=number, train_loss=train_loss, held_out=metrics))
        if on_epoch is not None:
            on_epoch(history[-1])
    return network.eval(), tuple(history)


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


class _Passes:
    """Passes over the training data: batches, loss, optimiser and schedule of one network."""

    def __init__(
        self,
        network: GraspQualityNetwork,
        data: GraspInputs,
        trained_on: NDArray[np.int64],
        settings: TrainSettings,
        generator: torch.Generator,
    ) -> None:
        self._network = network
        self._jitter = settings.jitter
        self._generator = generator
        self._samples = FLIPS * len(trained_on)
        self._loader = GraspLoader(
            FlippedGrasps(data),
            batch_size=settings.batch,
            # A negative seed counts as torch counts it: as 64 bits without a sign.
            seed=settings.seed % 2**64,
            rows=FlippedGrasps.positions(trained_on),
        )
        rate = settings.learning_rate
        self._optimiser = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=settings.weight_decay)
        self._schedule = torch.optim.lr_scheduler.OneCycleLR(
            self._optimiser, rate, total_steps=settings.epochs * len(self._loader)
        )
        share = float(data.labels[trained_on].mean())
        self._positive_weight = torch.tensor((1 - share) / share) if settings.balance and 0 < share < 1 else None

    def run_one(self) -> float:
        """See every attempt in all four flips once; returns the mean loss."""
        self._network.train()
        total_loss = 0.0
        for inputs, labels in self._loader:  # (B, 4, size, size) float16, (B,)
            if len(labels) < 2:
                continue  # batch normalisation has no variance over one input
            total_loss += len(labels) * self._step(self._jitter(inputs.float(), self._generator), labels)
        return total_loss / self._samples

    def _step(self, inputs: Tensor, labels: Tensor) -> float:
        """Descend once; returns the loss before. (B, 4, size, size), (B,)."""
        logits = self._network(inputs)  # (B,)
        loss = functional.binary_cross_entropy_with_logits(logits, labels, pos_weight=self._positive_weight)
        self._optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self._optimiser.step()
        self._schedule.step()
        return float(loss.detach())


def predict(network: GraspQualityNetwork, inputs: NDArray[np.float16], rows: Tensor) -> NDArray[np.float32]:
    """Predicted success of some rows of materialized inputs. Shape (len(rows),).

    Raises:
        ScoreError: A score is not in [0, 1].
    """
    network.eval()
    return _scores(lambda batch: torch.sigmoid(network(batch)), inputs, rows)


def predict_with_flips(network: GraspQualityNetwork, inputs: NDArray[np.float16], rows: Tensor) -> NDArray[np.float32]:
    """As :func:`predict`, with test-time augmentation: the mean over the four flips of each input."""
    network.eval()

    def mean_over_flips(batch: Tensor) -> Tensor:
        flips = [torch.sigmoid(network(flipped(batch, torch.full((len(batch),), which)))) for which in range(FLIPS)]
        return torch.stack(flips).mean(dim=0)

    return _scores(mean_over_flips, inputs, rows)


def _scores(score: Callable[[Tensor], Tensor], inputs: NDArray[np.float16], rows: Tensor) -> NDArray[np.float32]:
    """What ``score`` makes of the rows, a batch at a time. Shape (len(rows),)."""
    with torch.inference_mode():
        batches = [score(_read(inputs, batch)) for batch in rows.split(SCORE_BATCH) if len(batch)]
    scores = torch.cat(batches).numpy() if batches else np.empty(0, np.float32)
    check_scores(scores, len(rows))
    return scores


def _read(inputs: NDArray[np.float16], rows: Tensor) -> Tensor:
    return torch.from_numpy(np.asarray(inputs[rows.numpy()], dtype=np.float32))
