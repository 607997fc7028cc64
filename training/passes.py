"""Passes over the training data: batches, loss, optimiser and schedule of one network."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from handsight.datasets.inputs.augmentation import FLIPS
from handsight.datasets.inputs.loader import GraspLoader
from handsight.datasets.inputs.mixture import LabelledInputs
from handsight.datasets.inputs.torch_dataset import TorchGrasps
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.memory import keep_freed_memory
from handsight.training.optimiser import AdamW
from handsight.training.precision import dtype_for
from handsight.training.settings import TrainSettings

CPU = torch.device("cpu")


@dataclass(frozen=True, slots=True, kw_only=True)
class PassesState:
    """Where passes stand."""

    tensors: dict[str, Tensor]
    numbers: dict[str, Any]
    """JSON values."""


class Passes:
    """A network in training, and the running mean of its weights.

    Args:
        network: With its initial weights; it is changed.
        data: Inputs and labels.
        trained_on: Positions in ``data`` to learn from. Shape (M,).
        settings: The recipe.
        generator: Of all that inputs are varied by.
        device: Where the network is trained. Inputs are varied by the processor.
    """

    def __init__(
        self,
        network: GraspQualityNetwork,
        data: LabelledInputs,
        trained_on: NDArray[np.int64],
        settings: TrainSettings,
        generator: torch.Generator,
        *,
        device: torch.device = CPU,
    ) -> None:
        keep_freed_memory()
        # Strided convolutions of few channels are fastest in channels-last, forwards and backwards.
        self._network = network.to(device=device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._mean = _RunningMean(network, settings.average)
        self._settings = settings
        self._generator = generator
        self._rng = np.random.default_rng([settings.seed % 2**64, 1])
        self._device = device
        self._dtype = dtype_for(settings.precision, device)
        self._form = network.form(self._dtype)
        self._steps = 0
        self._samples = FLIPS * len(trained_on)
        self._loader = GraspLoader(
            TorchGrasps(data),
            batch_size=settings.batch,
            # A negative seed counts as torch counts it: as 64 bits without a sign.
            seed=settings.seed % 2**64,
            rows=np.repeat(trained_on, FLIPS),
        )
        self._optimiser = AdamW(network.parameters(), weight_decay=settings.weight_decay)
        share = float(data.labels[trained_on].mean())
        weighted = settings.balance and 0 < share < 1
        self._positive_weight = torch.tensor((1 - share) / share, device=device) if weighted else None

    @property
    def mean(self) -> GraspQualityNetwork:
        """The network with the running mean of the weights; the next pass changes it."""
        return self._mean.network

    def run_one(self) -> float:
        """See every attempt four times, in a flip of its own each time; returns the mean loss."""
        self._network.train()
        total_loss: float | Tensor = 0.0
        for inputs, labels in self._loader:  # (B, 4, size, size) float16, (B,)
            if len(labels) < 2:
                continue  # batch normalisation has no variance over one input
            varied = self._settings.jitter(inputs, self._generator, self._form)
            batch, mixed_labels = self._mixed(varied, labels)
            total_loss += len(labels) * self._step(
                batch.to(self._device, non_blocking=True), mixed_labels.to(self._device, non_blocking=True)
            )
        return float(total_loss) / self._samples

    def state(self) -> PassesState:
        """Everything that the next passes depend on; it does not change with them."""
        tensors = {f"network.{name}": tensor for name, tensor in self._network.state_dict().items()}
        tensors |= {f"mean.{name}": tensor for name, tensor in self.mean.state_dict().items()}
        tensors |= {f"optimiser.{name}": tensor for name, tensor in self._optimiser.state().items()}
        tensors["generator"] = self._generator.get_state()
        return PassesState(
            tensors={name: tensor.detach().cpu().clone() for name, tensor in tensors.items()},
            numbers={"steps": self._steps, "loader": self._loader.state_dict(), "rng": self._rng.bit_generator.state},
        )

    def load_state(self, state: PassesState) -> None:
        """Go on where the passes that gave the state stood.

        Raises:
            KeyError, RuntimeError: It is that of another network.
            LoaderStateError: It is that of other data.
        """
        self._network.load_state_dict(_below(state.tensors, "network."))
        self.mean.load_state_dict(_below(state.tensors, "mean."))
        self._optimiser.load_state(_below(state.tensors, "optimiser."))
        self._generator.set_state(state.tensors["generator"])
        self._loader.load_state_dict(state.numbers["loader"])
        self._rng.bit_generator.state = state.numbers["rng"]
        self._steps = state.numbers["steps"]

    def _mixed(self, inputs: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
        """Every input and label mixed with another of the batch, where the recipe has it."""
        if self._settings.mixup == 0:
            return inputs, labels
        share = self._rng.beta(self._settings.mixup, self._settings.mixup)
        return mixed_up(inputs, labels, torch.from_numpy(self._rng.permutation(len(labels))), share)

    def _step(self, inputs: Tensor, labels: Tensor) -> Tensor:
        """Descend once; returns the loss before, which is not waited for. (B, C, reach, reach), (B,)."""
        rate = self._settings.learning_rate * min(1.0, (self._steps + 1) / (self._settings.warmup_steps + 1))
        with torch.autocast(self._device.type, self._dtype, enabled=self._dtype != torch.float32):
            logits = self._network.logits_of(inputs.contiguous(memory_format=torch.channels_last))  # (B,)
        loss = functional.binary_cross_entropy_with_logits(logits.float(), labels, pos_weight=self._positive_weight)
        self._optimiser.forget_gradients()
        loss.backward()
        self._optimiser.step(rate)
        self._mean.update(self._steps)
        self._steps += 1
        return loss.detach().double()


def mixed_up(inputs: Tensor, labels: Tensor, others: Tensor, share: float) -> tuple[Tensor, Tensor]:
    """Inputs and labels of which the rest of a share is that of others (mixup; Zhang et al. 2018, equation 1).

    Args:
        inputs: Channels-last, or they are copied. Shape (B, C, side, side).
        labels: Shape (B,).
        others: Whose each is mixed with. Shape (B,).
        share: In [0, 1].

    Returns:
        Shapes as they were.
    """
    # As rows of one length: so they are copied in half the time.
    flat = inputs.permute(0, 2, 3, 1).flatten(1)
    mixed = flat.index_select(0, others).lerp_(flat, share).view(len(inputs), *inputs.shape[2:], -1)
    return mixed.permute(0, 3, 1, 2), torch.lerp(labels[others], labels, share)


class _RunningMean:
    """A network with the exponential running mean of another's weights and statistics, which stay where they are.

    The first steps count less, as those of a network that knows nothing yet: after n steps the factor for the past is
    at most (n + 1) / (n + 10).
    """

    def __init__(self, network: GraspQualityNetwork, factor: float) -> None:
        self.network = copy.deepcopy(network).eval().requires_grad_(False)
        self._factor = factor
        self._of, self._into = _floats(network), _floats(self.network)

    @torch.no_grad()
    def update(self, steps: int) -> None:
        """Count the weights that there are now, after so many steps that were counted before."""
        factor = min(self._factor, (steps + 1) / (steps + 10))
        torch._foreach_lerp_(self._into, self._of, 1 - factor)


def _floats(network: nn.Module) -> list[Tensor]:
    """Weights and statistics, in one order; what batch normalisation counts has no part in what it computes."""
    return [tensor for tensor in network.state_dict().values() if tensor.dtype.is_floating_point]


def _below(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """Those whose names begin so, without the beginning."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}
