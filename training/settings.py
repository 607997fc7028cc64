"""The recipe by which a network is trained (docs/decisions/025-when-training-ends.md)."""

from __future__ import annotations

from dataclasses import dataclass, field

from handsight.datasets.errors import below_least, counted
from handsight.datasets.inputs.augmentation import Jitter
from handsight.training.errors import TrainerSettingsError
from handsight.training.gqn import GqnConfig
from handsight.training.precision import Precision


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainSettings:
    """The whole recipe."""

    network: GqnConfig = field(default_factory=GqnConfig)
    epochs: int = 40
    """Most passes over the data; in each, every attempt is seen four times, flipped at random."""
    least_epochs: int = 8
    """The pass that is kept is this one or a later one. Of few attempts held out, an early lowest loss is chance."""
    patience: int = 3
    """Training ends when the loss on held-out attempts has not fallen for so many passes. Without held-out attempts
    there are ``epochs``."""
    batch: int = 200
    learning_rate: float = 2e-3
    """Reached after ``warmup_steps``, and kept."""
    warmup_steps: int = 100
    average: float = 0.995
    """The network that is kept has the running mean of the weights, with this factor for its past at every step; it
    does what a falling learning rate would do, and needs no end that is known before. 0 for the last weights."""
    weight_decay: float = 0.01
    mixup: float = 0.2
    """Inputs and labels of a batch are mixed with those of others, by a share drawn from Beta(mixup, mixup) (Zhang et
    al. 2018, mixup: Beyond empirical risk minimization). 0 for none."""
    balance: bool = False
    """Weigh the rarer successes so that both classes count alike. Without, S is the chance that the grasp succeeds,
    which is what the servo loop's threshold is compared with."""
    holdout: float = 0.1
    """Share of the attempts held out, to choose the pass by and to report quality on."""
    jitter: Jitter = field(default_factory=Jitter)
    precision: Precision = "auto"
    """Of the numbers that layers compute with. Weights, their mean and the loss are float32."""
    seed: int = 0

    def __post_init__(self) -> None:
        faults = []
        if self.epochs < 1 or self.batch < 2:
            faults.append(
                f"{counted(self.epochs, 'epoch')} at batch {self.batch}, expected at least 1 epoch and 2 in a batch"
            )
        faults += below_least(self, least_epochs=1, patience=1, warmup_steps=0)
        if not (0 < self.learning_rate < 1 and 0 <= self.weight_decay < 1):
            faults.append(
                f"learning rate is {self.learning_rate}, weight decay {self.weight_decay}, expected in (0, 1), [0, 1)"
            )
        if not (0 <= self.holdout < 1 and 0 <= self.average < 1):
            faults.append(f"holdout is {self.holdout}, average {self.average}, expected both in [0, 1)")
        if not 0 <= self.mixup <= MOST_MIXUP:
            faults.append(f"mixup is {self.mixup}, expected in [0, {MOST_MIXUP}]")
        if faults:
            raise TrainerSettingsError("; ".join(faults))


MOST_MIXUP = 10.0
"""Above it nearly all shares are halves."""
