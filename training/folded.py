"""A trained network as inference wants it: the same function in fewer and cheaper operations.

In inference batch normalisation is a scale and a shift of each channel, which the convolution before it can do, and so
is the fixed normalisation of the inputs, which the first convolution can do. The layout is channels-last, in which
strided convolutions of few channels are fastest.

Without a border of zeros (``GqnConfig.padded``) overlapping crops of a picture share what is computed at their common
pixels. The scores of all crops then are one convolution after another over the whole picture, each with the strides of
those before it as its dilation (the "a trous" algorithm; Giusti et al. 2013, Fast image scanning with deep max-pooling
convolutional neural networks).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from handsight.training.gqn import CHANNEL_SETS, GqnConfig, GraspQualityNetwork


@dataclass(frozen=True, slots=True, kw_only=True)
class _Layer:
    """A convolution, or a dense layer."""

    weight: Tensor
    """Shape (out, in, kernel, kernel) or (out, in)."""
    bias: Tensor
    """Shape (out,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FoldedNetwork:
    """Weights without batch normalisation, on the device of the network that they were made of."""

    config: GqnConfig
    convolutions: tuple[_Layer, ...]
    dense: tuple[_Layer, ...]
    """The first in the type of the convolutions, the others in float32."""
    normalisation: tuple[Tensor, Tensor] | None
    """Shift and scale of the inputs, each of shape (C, 1, 1); None where the first convolution does it."""

    def logits(self, inputs: Tensor) -> Tensor:
        """As the network's ``forward``, in inference. (B, 4, size, size) -> (B,), float32."""
        reach_px = self.config.reach_px
        x = self._prepared(inputs[..., :reach_px, :reach_px])
        for layer, kernel in zip(self.convolutions, self.config.kernels, strict=True):
            border_px = self.config.border_px(kernel)
            x = functional.elu_(functional.conv2d(x, layer.weight, layer.bias, stride=2, padding=border_px))
        first, *others = self.dense
        return self._ended(functional.linear(x.flatten(1), first.weight, first.bias), others)

    def logits_map(self, picture: Tensor, *, every: int) -> Tensor:
        """The logits of all crops of a picture, computed together; of a network without padding.

        Crop (r, c) begins at pixel (every * r, every * c). Each layer is computed at the steps between positions that
        any crop needs: the greatest common divisor of ``every`` and of its stride in the picture.

        Args:
            picture: At the network's resolution, no side below ``size_px``. Shape (4, H, W).
            every: Step between crops, in pixels.

        Returns:
            Shape (R, C) with R = (H - size_px) // every + 1, and C likewise of W; float32.
        """
        size_px = self.config.size_px
        end_row, end_column = (
            (side - size_px) // every * every + self.config.reach_px for side in (picture.shape[1], picture.shape[2])
        )
        x = self._prepared(picture[None, :, :end_row, :end_column])
        stride_px, step_px = 1, 1  # between the taps of a kernel, and between the positions that are computed
        for layer in self.convolutions:
            dilation, stride = stride_px // step_px, math.gcd(every, 2 * stride_px) // step_px
            x = functional.elu_(functional.conv2d(x, layer.weight, layer.bias, stride=stride, dilation=dilation))
            stride_px, step_px = 2 * stride_px, step_px * stride
        # The first dense layer reads what is left of a crop: over a picture it is one convolution more.
        first, *others = self.dense
        side = self.config.sides[-1]
        kernel = first.weight.view(len(first.weight), -1, side, side).contiguous(memory_format=torch.channels_last)
        x = functional.conv2d(x, kernel, first.bias, stride=every // step_px, dilation=stride_px // step_px)
        return self._ended(x[0].permute(1, 2, 0), others)  # of (R, C, width)

    def _prepared(self, inputs: Tensor) -> Tensor:
        """The channels that are read, in the type of the weights, channels-last."""
        picked = CHANNEL_SETS[self.config.channels]
        x = inputs if len(picked) == inputs.shape[1] else inputs[:, picked[0] : picked[-1] + 1]
        if self.normalisation is not None:
            shift, scale = self.normalisation
            x = (x - shift) / scale
        return x.to(self.dense[0].weight.dtype, memory_format=torch.channels_last)

    def _ended(self, x: Tensor, layers: Sequence[_Layer]) -> Tensor:
        """The logits after the other dense layers, from what the first gives. (..., width) -> (...), float32."""
        x = x.float()
        for layer in layers:
            x = functional.linear(functional.selu_(x), layer.weight, layer.bias)
        return x[..., 0]


def folded(network: GraspQualityNetwork, *, dtype: torch.dtype = torch.float32) -> FoldedNetwork:
    """Fold the network's statistics into its weights; the network stays as it is.

    Args:
        network: In training or not: it is taken as in inference.
        dtype: Type of the numbers to compute with.
    """
    convolutions = []
    for at in range(len(network.config.widths)):
        convolution, norm = network.features[3 * at], network.features[3 * at + 1]
        convolutions.append(_without_norm(cast("nn.Conv2d", convolution), cast("nn.BatchNorm2d", norm)))
    normalisation = network.get_buffer("shift"), network.get_buffer("scale")
    # A border of zeros would stand for other colours once the shift is folded in, and bfloat16 has most digits near 0.
    foldable = not network.config.padded and dtype == torch.float32
    if foldable:
        convolutions[0] = _after_normalisation(convolutions[0], *normalisation)
    first, *others = (layer for layer in network.head if isinstance(layer, nn.Linear))
    return FoldedNetwork(
        config=network.config,
        convolutions=tuple(_held(layer.weight, layer.bias, dtype) for layer in convolutions),
        # A logit of bfloat16 has two or three digits; the last layers cost next to nothing.
        dense=(
            _held(first.weight, first.bias, dtype),
            *(_held(layer.weight, layer.bias, torch.float32) for layer in others),
        ),
        normalisation=None if foldable else normalisation,
    )


def _held(weight: Tensor, bias: Tensor, dtype: torch.dtype) -> _Layer:
    """A copy to compute with."""
    layout = torch.channels_last if weight.ndim == 4 else torch.contiguous_format
    return _Layer(
        weight=weight.detach().to(dtype, copy=True, memory_format=layout), bias=bias.detach().to(dtype, copy=True)
    )


def _without_norm(convolution: nn.Conv2d, norm: nn.BatchNorm2d) -> _Layer:
    """The convolution that does the work of both, in float64."""
    weight = convolution.weight.detach().double()
    mean, variance = norm.get_buffer("running_mean").double(), norm.get_buffer("running_var").double()
    factor = norm.weight.detach().double() / torch.sqrt(variance + norm.eps)  # (out,)
    return _Layer(weight=weight * factor[:, None, None, None], bias=norm.bias.detach().double() - mean * factor)


def _after_normalisation(layer: _Layer, shift: Tensor, scale: Tensor) -> _Layer:
    """The convolution that reads inputs as they are, in float64."""
    weight = layer.weight / scale.double()  # (out, C, kernel, kernel)
    return _Layer(weight=weight, bias=layer.bias - (weight * shift.double()).sum(dim=(1, 2, 3)))
