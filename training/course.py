"""How a training goes, pass by pass."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from handsight.training.metrics import Metrics


@dataclass(frozen=True, slots=True, kw_only=True)
class Epoch:
    """Progress after one pass."""

    number: int
    """From 1."""
    train_loss: float
    held_out: Metrics


@dataclass(slots=True)
class Course:
    """How a training went so far."""

    history: list[Epoch]
    kept: int
    """Position in the history of the pass after which the network is kept."""
    weights: dict[str, Tensor]
    """The network after that pass."""
