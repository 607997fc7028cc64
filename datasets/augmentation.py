"""Augmentation of network inputs (section V-A): mirrored both ways, brightness varied, pixels noisy.

Mirroring keeps the label because the gripper is symmetric and the input is centred on the grasp. Nothing here moves the
picture against the gripper, which would change what the label means.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

MIRRORINGS = 4
"""As recorded, left-right, top-bottom, both."""

_COLOURS = slice(0, 3)
_HEIGHT = slice(3, 4)


def mirrored(inputs: Tensor, which: Tensor) -> Tensor:
    """Each input in the mirroring 0 to 3 that ``which`` (B,) names. (B, C, size, size) -> the same shape."""
    which = which[:, None, None, None]
    once = torch.where(which % 2 == 1, inputs.flip(3), inputs)
    return torch.where(which >= 2, once.flip(2), once)


@dataclass(frozen=True, slots=True, kw_only=True)
class Jitter:
    """How strongly inputs are varied; zero switches a part off."""

    brightness: float = 0.2
    """Colours are multiplied by a factor within 1 ± this, one for each input."""
    colour_noise: float = 0.02
    """Standard deviation of the noise on each pixel's colours, which lie in [0, 1]."""
    height_noise_m: float = 0.001
    """Standard deviation of the noise on each pixel's height [m]."""

    def __call__(self, inputs: Tensor, generator: torch.Generator) -> Tensor:
        """A varied copy of a batch. (B, 4, size, size) -> (B, 4, size, size)."""
        factor = 1 + self.brightness * (2 * torch.rand(len(inputs), 1, 1, 1, generator=generator) - 1)
        colours, height_m = inputs[:, _COLOURS], inputs[:, _HEIGHT]
        return torch.cat(
            [
                colours * factor + self.colour_noise * torch.randn(colours.shape, generator=generator),
                height_m + self.height_noise_m * torch.randn(height_m.shape, generator=generator),
            ],
            dim=1,
        )
