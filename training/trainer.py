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
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.training.errors import TrainerSettingsError, TrainingDataError
from handsight.training.gqn import GqnConfig, GraspQualityNetwork, Scorer
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
    """Share of the attempts kept aside to report accuracy on."""
    jitter: Jitter = field(default_factory=Jitter)
    seed: int = 0

    def __post_init__(self) -> None:
        faults = []
        if self.epochs < 1 or self.batch < 2:
            faults.append(f"{self.epochs} epochs at batch {self.batch}, expected at least 1 epoch and 2 in a batch")
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
    """
    labels = torch.from_numpy(data.labels)
    used = torch.arange(len(labels)) if rows is None else torch.from_numpy(rows)
    positives = float(labels[used].sum())
    if positives in (0.0, float(len(used))):
        raise TrainingDataError(
            f"{positives:.0f} of {counted(len(used), 'attempt')} are successes, expected some of both: "
            "collect more attempts"
        )
    # Everything random hangs on one generator, but for the initial weights, which torch draws from its global one.
    generator = torch.Generator().manual_seed(settings.seed)
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(settings.seed)
        network = GraspQualityNetwork(settings.network)

    shuffled = used[torch.randperm(len(used), generator=generator)]
    held_out, trained_on = shuffled.tensor_split([int(settings.holdout * len(used))])
    trained_on = trained_on.sort().values  # memory-mapped reads run forwards

    # --- optimiser and schedule
    batches = math.ceil(len(trained_on) * FLIPS / settings.batch)
    optimiser = torch.optim.AdamW(network.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, settings.learning_rate, total_steps=settings.epochs * batches
    )
    share = float(labels[trained_on].mean())
    positive_weight = torch.tensor((1 - share) / share) if settings.balance and 0 < share < 1 else None

    history = []
    for number in range(1, settings.epochs + 1):
        network.train()
        total_loss = 0.0
        order = torch.randperm(len(trained_on) * FLIPS, generator=generator)
        for chosen in order.split(settings.batch):
            if len(chosen) < 2:
                continue  # batch normalisation has no variance over one input

            # --- batch: read, mirror, jitter
            attempts = trained_on[chosen // FLIPS]
            inputs = _read(data.inputs, attempts)  # (B, 4, size, size)
            inputs = settings.jitter(flipped(inputs, chosen % FLIPS), generator)

            # --- forward, backward, step
            logits = network(inputs)  # (B,)
            loss = functional.binary_cross_entropy_with_logits(logits, labels[attempts], pos_weight=positive_weight)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
            schedule.step()
            total_loss += float(loss.detach()) * len(chosen)

        # --- report
        metrics = evaluate_scores(predict(network, data.inputs, held_out), labels[held_out].numpy())
        history.append(Epoch(number=number, train_loss=total_loss / len(order), held_out=metrics))
        if on_epoch is not None:
            on_epoch(history[-1])
    return network.eval(), tuple(history)


def predict(network: GraspQualityNetwork, inputs: NDArray[np.float16], rows: Tensor) -> NDArray[np.float32]:
    """Predicted success of some rows of materialized inputs. Shape (len(rows),)."""
    score = Scorer(network)
    scores = [score(_read(inputs, batch)) for batch in rows.split(SCORE_BATCH) if len(batch)]
    return torch.cat(scores).numpy() if scores else np.empty(0, np.float32)


def predict_with_flips(network: GraspQualityNetwork, inputs: NDArray[np.float16], rows: Tensor) -> NDArray[np.float32]:
    """As :func:`predict`, averaged over the four flips of each input. Shape (len(rows),)."""
    score = Scorer(network)
    scores = []
    for batch in rows.split(SCORE_BATCH):
        read = _read(inputs, batch)
        variants = [score(flipped(read, torch.full((len(batch),), which))) for which in range(FLIPS)]
        scores.append(torch.stack(variants).mean(dim=0))
    return torch.cat(scores).numpy()


def _read(inputs: NDArray[np.float16], rows: Tensor) -> Tensor:
    return torch.from_numpy(np.asarray(inputs[rows.numpy()], dtype=np.float32))
