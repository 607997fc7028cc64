"""Augmentation of network inputs (section V-A): flipped both ways, brightness varied, pixels noisy.

A flip keeps the label because the gripper is symmetric and the input is centred on the grasp. Beyond the paper,
inputs are turned and shifted by a little: a grasp a few millimetres beside a good one is still likely to be good, and a
network that has to say so is far less sure of itself where it should not be
(docs/decisions/007-inputs-are-moved-a-little.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

_FLIPPED_AXES = ((), (3,), (2,), (2, 3))
FLIPS = len(_FLIPPED_AXES)
"""As recorded, left-right, top-bottom, both."""

_SHARING_NOISE = 4
"""So many inputs of a batch have the same noise added: drawing it would take longer than all else that is done here."""


def flipped(inputs: Tensor, which: Tensor) -> Tensor:
    """Each input in the flip 0 to 3 that ``which`` (B,) names. (B, C, size, size) -> the same shape and type."""
    result = inputs.clone()
    for flip, axes in enumerate(_FLIPPED_AXES):
        own = which == flip
        if axes and own.any():
            result[own] = inputs[own].flip(axes)
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class Jitter:
    """How strongly inputs are varied; zero switches a part off."""

    brightness: float = 0.2
    """Colours are multiplied by a factor within 1 ± this, one for each input."""
    colour_noise: float = 0.02
    """Standard deviation of the noise on each pixel's colours, which lie in [0, 1]."""
    height_noise_m: float = 0.001
    """Standard deviation of the noise on each pixel's height [m]."""
    turn_rad: float = 0.17
    """Inputs are turned by up to this, either way, about the grasp point."""
    shift: float = 1.5 / 64
    """Inputs are shifted by up to this share of their width, either way, in both directions; 7 mm on the table."""

    def __call__(self, inputs: Tensor, generator: torch.Generator) -> Tensor:
        """A varied copy of a batch. (B, 4, size, size) -> (B, 4, size, size)."""
        batch, *shape = inputs.shape
        factor = torch.ones(batch, 4, 1, 1)
        factor[:, :3] += self.brightness * (2 * torch.rand(batch, 1, 1, 1, generator=generator) - 1)
        noise = torch.randn(-(-batch // _SHARING_NOISE), *shape, generator=generator)
        noise *= torch.tensor([*3 * [self.colour_noise], self.height_noise_m])[:, None, None]
        return torch.addcmul(noise.repeat(_SHARING_NOISE, 1, 1, 1)[:batch], self._moved(inputs, generator), factor)

    def _moved(self, inputs: Tensor, generator: torch.Generator) -> Tensor:
        """Each input turned and shifted a little; edges are replicated. (B, 4, size, size) -> the same shape."""
        if self.turn_rad == 0 and self.shift == 0:
            return inputs
        batch = len(inputs)
        angle_rad = self.turn_rad * (2 * torch.rand(batch, generator=generator) - 1)
        # In units of half a width, as affine_grid has it.
        shift = 2 * self.shift * (2 * torch.rand(batch, 2, generator=generator) - 1)
        cos, sin = torch.cos(angle_rad), torch.sin(angle_rad)
        maps = torch.stack(
            [torch.stack([cos, -sin, shift[:, 0]], -1), torch.stack([sin, cos, shift[:, 1]], -1)], 1
        )  # (B, 2, 3)
        points = functional.affine_grid(maps, list(inputs.shape), align_corners=False)
        return functional.grid_sample(inputs, points, padding_mode="border", align_corners=False)
