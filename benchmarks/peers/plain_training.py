"""A pass of training in which every part of augmentation is a step of its own, in float32: what handsight once did.

Of the whole pictures, what no score depends on included, and with memory that is given back to the system.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from handsight.datasets.inputs.loader import GraspLoader
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.datasets.inputs.torch_dataset import FlippedGrasps
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.settings import TrainSettings

_SHARING_NOISE = 4


class PlainTraining:
    """A network in training.

    Args:
        data: Inputs and labels.
        settings: The recipe, of which mixup and the running mean are left out.
        dtype: Of the numbers that layers compute with.
    """

    def __init__(self, data: GraspInputs, settings: TrainSettings, *, dtype: torch.dtype) -> None:
        torch.manual_seed(0)
        self._network = GraspQualityNetwork(settings.network).train()
        self._dtype = dtype
        self._jitter = settings.jitter
        self._generator = torch.Generator().manual_seed(0)
        rows = FlippedGrasps.positions(np.arange(len(data.labels)))
        self._loader = GraspLoader(FlippedGrasps(data), batch_size=settings.batch, seed=0, rows=rows)
        self._optimiser = torch.optim.AdamW(
            self._network.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay
        )

    def run_one(self) -> None:
        """See every attempt in all four flips."""
        for inputs, labels in self._loader:
            with torch.autocast("cpu", self._dtype, enabled=self._dtype != torch.float32):
                logits = self._logits(self._varied(inputs.float()))
            loss = functional.binary_cross_entropy_with_logits(logits.float(), labels)
            self._optimiser.zero_grad(set_to_none=True)
            loss.backward()
            self._optimiser.step()

    def _logits(self, inputs: Tensor) -> Tensor:
        """(B, 4, size, size) -> (B,)."""
        normalised = (inputs - self._network.get_buffer("shift")) / self._network.get_buffer("scale")
        logits: Tensor = self._network.head(self._network.features(normalised))
        return logits[:, 0]

    def _varied(self, inputs: Tensor) -> Tensor:
        """(B, 4, size, size) -> the same shape."""
        jitter, generator, (batch, *shape) = self._jitter, self._generator, inputs.shape
        angle_rad = jitter.turn_rad * (2 * torch.rand(batch, generator=generator) - 1)
        shift = 2 * jitter.shift * (2 * torch.rand(batch, 2, generator=generator) - 1)
        cos, sin = torch.cos(angle_rad), torch.sin(angle_rad)
        rows = [torch.stack([cos, -sin, shift[:, 0]], -1), torch.stack([sin, cos, shift[:, 1]], -1)]
        points = functional.affine_grid(torch.stack(rows, 1), list(inputs.shape), align_corners=False)
        moved = functional.grid_sample(inputs, points, padding_mode="border", align_corners=False)
        factor = torch.ones(batch, 4, 1, 1)
        factor[:, :3] += jitter.brightness * (2 * torch.rand(batch, 1, 1, 1, generator=generator) - 1)
        noise = torch.randn(-(-batch // _SHARING_NOISE), *shape, generator=generator)
        noise *= torch.tensor([*3 * [jitter.colour_noise], jitter.height_noise_m])[:, None, None]
        return torch.addcmul(noise.repeat(_SHARING_NOISE, 1, 1, 1)[:batch], moved, factor)
