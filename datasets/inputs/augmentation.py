"""Augmentation of network inputs (section V-A): flipped both ways, brightness varied, pixels noisy.

A flip keeps the label because the gripper is symmetric and the input is centred on the grasp. Beyond the paper,
inputs are turned and shifted by a little: a grasp a few millimetres beside a good one is still likely to be good, and a
network that has to say so is far less sure of itself where it should not be
(docs/decisions/007-inputs-are-moved-a-little.md).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

_FLIPPED_AXES = ((), (3,), (2,), (2, 3))
FLIPS = len(_FLIPPED_AXES)
"""As recorded, left-right, top-bottom, both."""

_AT_A_TIME = 8
"""Inputs that are varied together."""
_NOISE_OFFSETS = 100_003
"""Noise is drawn once, and inputs read it from one of so many places on: drawing it anew would take longer than all
else that is done here."""


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

    flips: bool = True
    """Whether inputs are flipped at random, left-right and top-bottom."""

    def __call__(self, inputs: Tensor, generator: torch.Generator) -> Tensor:
        """A varied copy of a batch. (B, 4, size, size) -> (B, 4, size, size), float32, channels-last."""
        batch, channels, size, _ = inputs.shape
        factor = torch.ones(batch, channels)
        factor[:, :3] += self.brightness * (2 * torch.rand(batch, 1, generator=generator) - 1)
        # A whole row of a picture at a time: over four channels alone, loops would be too short to be fast.
        factor = factor.repeat(1, size)[:, None]  # (B, 1, size * 4)
        maps = self._maps(batch, size, generator) if self.flips or self.turn_rad or self.shift else None
        noise = (
            _drawn(size, self.colour_noise, self.height_noise_m) if self.colour_noise or self.height_noise_m else None
        )
        offsets = torch.randint(_NOISE_OFFSETS, (batch,), generator=generator).tolist()
        varied = torch.empty(batch, size, size * channels)
        # A few pictures at a time, so that what is read next is still in the processor's cache.
        with _one_thread():
            for first in range(0, batch, _AT_A_TIME):
                part = slice(first, first + _AT_A_TIME)
                goal = varied[part]
                _move(inputs[part], goal, None if maps is None else maps[part])
                if noise is None:
                    goal.mul_(factor[part])
                else:
                    window = noise[4 * offsets[first] :][: goal.numel()].view(goal.shape)
                    torch.addcmul(window, goal, factor[part], out=goal)
        return varied.view(batch, size, size, channels).permute(0, 3, 1, 2)

    def _maps(self, batch: int, size: int, generator: torch.Generator) -> NDArray[np.float64]:
        """Where each pixel [px] of each varied input is read from. Shape (B, 2, 3)."""
        mirrored = 1.0 - 2.0 * torch.randint(
            2 if self.flips else 1, (batch, 2), generator=generator
        )  # of columns, rows
        angle_rad = self.turn_rad * (2 * torch.rand(batch, generator=generator) - 1)
        shift_px = size * self.shift * (2 * torch.rand(batch, 2, generator=generator) - 1)
        cos, sin = torch.cos(angle_rad), torch.sin(angle_rad)
        turns = torch.stack([cos, -sin, sin, cos], -1).view(batch, 2, 2) * mirrored[:, None, :]
        # About the middle of the picture, which lies between pixels where their number is even.
        middle_px = torch.full((2,), (size - 1) / 2)
        offsets_px = middle_px - turns @ middle_px + shift_px
        return torch.cat([turns, offsets_px[..., None]], -1).double().numpy()


def _move(inputs: Tensor, goal: Tensor, maps: NDArray[np.float64] | None) -> None:
    """Resample some inputs, or copy them where there are no maps; edges are replicated.

    (B, 4, size, size) -> (B, size, size * 4), which is how OpenCV has pictures.
    """
    batch, channels, size, _ = inputs.shape
    pictures = inputs.permute(0, 2, 3, 1)  # (B, size, size, 4)
    if maps is None:
        goal.view(batch, size, size, channels).copy_(pictures)
        return
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    sources, goals = pictures.contiguous().float().numpy(), goal.view(batch, size, size, channels).numpy()
    for source, moved, matrix in zip(sources, goals, maps, strict=True):
        cv2.warpAffine(source, matrix, (size, size), moved, flags, cv2.BORDER_REPLICATE)


@contextmanager
def _one_thread() -> Iterator[None]:
    """OpenCV would share every one of these small pictures among its threads, which takes longer than the picture."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


@cache
def _drawn(size: int, colour_noise: float, height_noise_m: float) -> Tensor:
    """Noise for a few inputs of some size, from any of the offsets on. Shape (4 * pixels,)."""
    pixels = _AT_A_TIME * size**2 + _NOISE_OFFSETS
    drawn = torch.randn(pixels, 4, generator=torch.Generator().manual_seed(0))
    return (drawn * torch.tensor([*3 * [colour_noise], height_noise_m])).ravel()
