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

_AT_A_TIME = 16
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
class InputForm:
    """How a network reads its inputs: which pixels and channels, of what order, in which numbers.

    A network that brings its inputs to this form itself reads and writes the whole batch twice more.
    """

    size_px: int | None = None
    """So many rows and columns, from the first; None for all."""
    first: int = 0
    """Of the channels that are kept, side by side."""
    shift: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    """What is taken from the numbers of each of these channels."""
    scale: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    """By which they are divided then."""
    dtype: torch.dtype = torch.float32

    @property
    def channels(self) -> slice:
        """Those that are kept."""
        return slice(self.first, self.first + len(self.scale))


AS_RECORDED = InputForm()


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

    def __call__(self, inputs: Tensor, generator: torch.Generator, form: InputForm = AS_RECORDED) -> Tensor:
        """A varied copy of a batch, in the form asked for; what is drawn does not depend on the form.

        (B, 4, size, size) -> (B, C, side, side), channels-last.
        """
        batch, _, size, _ = inputs.shape
        side, channels = form.size_px or size, len(form.scale)
        factor = torch.ones(batch, 4)
        factor[:, :3] += self.brightness * (2 * torch.rand(batch, 1, generator=generator) - 1)
        # A whole row of a picture at a time: over four channels alone, loops would be too short to be fast.
        factor = (factor[:, form.channels] / torch.tensor(form.scale)).repeat(1, side)[:, None]  # (B, 1, side * C)
        maps = self._maps(batch, size, generator) if self.flips or self.turn_rad or self.shift else None
        noise = _drawn(side, self.colour_noise, self.height_noise_m, form)
        offsets = torch.randint(_NOISE_OFFSETS, (batch,), generator=generator).tolist()
        varied = torch.empty(batch, side, side * channels, dtype=form.dtype)
        moved = torch.empty(_AT_A_TIME, side, side * channels)
        # A few pictures at a time, so that what is read next is still in the processor's cache.
        with _one_thread():
            for first in range(0, batch, _AT_A_TIME):
                part = slice(first, first + _AT_A_TIME)
                some = moved[: len(factor[part])]
                _move(inputs[part, form.channels], some, None if maps is None else maps[part])
                window = noise[channels * offsets[first] :][: some.numel()].view(some.shape)
                torch.addcmul(window, some, factor[part], out=varied[part])
        return varied.view(batch, side, side, channels).permute(0, 3, 1, 2)

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
    """Resample the first rows and columns of some inputs, or copy them where there are no maps; edges are replicated.

    (B, C, size, size) -> (B, side, side * C), which is how OpenCV has pictures.
    """
    batch, channels, size, _ = inputs.shape
    side = goal.shape[1]
    pictures = goal.view(batch, side, side, channels)
    if maps is None:
        pictures.copy_(inputs[..., :side, :side].permute(0, 2, 3, 1))
        return
    # OpenCV puts planes side by side in a third of the time that a copy in another order takes.
    beside = torch.empty(batch, size, size, channels, dtype=inputs.dtype)
    for planes, picture in zip(inputs.numpy(), beside.numpy(), strict=True):
        cv2.merge(list(planes), picture)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    for source, moved, matrix in zip(beside.float().numpy(), pictures.numpy(), maps, strict=True):
        cv2.warpAffine(source, matrix, (side, side), moved, flags, cv2.BORDER_REPLICATE)


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
def _drawn(side: int, colour_noise: float, height_noise_m: float, form: InputForm) -> Tensor:
    """Noise for a few inputs of some side, from any of the offsets on, less the form's shift. Shape (C * pixels,)."""
    pixels = _AT_A_TIME * side**2 + _NOISE_OFFSETS
    drawn = torch.randn(pixels, 4, generator=torch.Generator().manual_seed(0))
    drawn = (drawn * torch.tensor([*3 * [colour_noise], height_noise_m]))[:, form.channels]
    return ((drawn - torch.tensor(form.shift)) / torch.tensor(form.scale)).ravel()
