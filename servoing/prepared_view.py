"""A view prepared once, so that many warps of it are cheap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from handsight.servoing.camera import HandCamera
from handsight.servoing.view import View

_LARGEST_SHORT = 16
"""Largest cells over which bytes add up to 16 bits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreparedView:
    """A view as four filtered channels, ready to be resampled.

    ``channels`` are red, green, blue in [0, 1] and the height below the mean plane [m]. They are low-pass filtered and
    decimated for the network's coarse grid, so that one bilinear sample per output pixel does not alias.
    """

    channels: Tensor
    """Shape (4, H', W'), float32."""
    pixels_per_cell: int
    """Raw pixels per decimated pixel, in each direction."""
    plane_m: float
    camera: HandCamera

    @classmethod
    def from_view(cls, view: View, *, pixels_per_cell: int) -> PreparedView:
        """Filter and decimate by an integer factor; 1 keeps the picture as it is."""
        plane_m, factor = view.plane_m, pixels_per_cell
        valid = view.valid
        whole = bool(valid.all())
        # Colours are added up as the integers that they are, and the plane is taken off cells, not off pixels: the
        # pictures are read once and never copied as floats.
        colours = _cell_sums(view.rgb, factor, np.uint16 if factor <= _LARGEST_SHORT else np.uint32)  # (3, H', W')
        depths_m = _cell_sums(view.depth_m if whole else np.where(valid, view.depth_m, 0), factor, np.float32)
        counts = np.full_like(depths_m, factor**2) if whole else _cell_sums(valid, factor, np.float32)
        channels = torch.empty(4 if whole else 5, *depths_m.shape)
        parts = channels.numpy()
        np.divide(colours, np.float32(255), out=parts[:3])
        np.subtract(depths_m, np.float32(plane_m) * counts, out=parts[3])
        if not whole:
            parts[4] = counts
        channels /= factor**2
        if factor > 1:
            channels = _smoothed(channels)
        if not whole:
            # Normalised convolution: invalid pixels take part with weight zero and are filled from their neighbours.
            depth_m, weight = channels[3], channels[4]
            channels[3] = torch.where(weight > 0, depth_m / weight.clamp_min(1e-6), 0.0)
            channels = channels[:4]
        return cls(channels=channels, pixels_per_cell=factor, plane_m=plane_m, camera=view.camera)


def _cell_sums(picture: NDArray[Any], factor: int, dtype: type[np.number[Any]]) -> NDArray[Any]:
    """Sums over factor x factor cells; where the last ones reach over the edge, it is replicated.

    (H, W) -> (H', W'), (H, W, C) -> (C, H', W').
    """
    sums = picture[::factor].astype(dtype)
    for offset in range(1, factor):
        rows = picture[offset::factor]
        sums[: len(rows)] += rows
        if len(rows) < len(sums):
            sums[-1] += picture[-1]
    # Channel by channel, where columns are added in long loops: side by side, every loop would be of three numbers.
    planes = sums if sums.ndim == 2 else np.ascontiguousarray(np.moveaxis(sums, 2, 0))
    return _sums_along_columns(planes, factor)


def _sums_along_columns(planes: NDArray[Any], factor: int) -> NDArray[Any]:
    """Sums of ``factor`` columns each. (..., W) -> (..., W')."""
    sums = planes[..., ::factor].copy()
    for offset in range(1, factor):
        columns = planes[..., offset::factor]
        whole = columns.shape[-1]
        sums[..., :whole] += columns
        if whole < sums.shape[-1]:
            sums[..., -1] += planes[..., -1]
    return sums


def _smoothed(stack: Tensor) -> Tensor:
    """[1 2 1] along both axes, edges replicated: after the mean over cells enough not to alias. (C, H, W)."""
    padded = functional.pad(stack[None], (1, 1, 1, 1), mode="replicate")[0]
    rows = 0.25 * padded[:, :-2] + 0.5 * padded[:, 1:-1] + 0.25 * padded[:, 2:]
    return 0.25 * rows[:, :, :-2] + 0.5 * rows[:, :, 1:-1] + 0.25 * rows[:, :, 2:]
