"""A view prepared once, so that many warps of it are cheap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from handsight.servoing.camera import HandCamera
from handsight.servoing.view import View, mean_depth_m

_LARGEST_SHORT = 16
"""Largest cells over which bytes add up to 16 bits."""
_LEAST_WEIGHT = np.float32(1e-6)
"""Less than one measured pixel under the filter weighs; what has none at all stays at the plane."""
_ONE_TWO_ONE = np.array([0.25, 0.5, 0.25])


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
        factor = pixels_per_cell
        measured_m = view.measured_m
        plane_m = mean_depth_m(measured_m)
        whole = cv2.countNonZero(measured_m) == measured_m.size
        # Colours are added up as the integers that they are, and the plane is taken off cells, not off pixels: the
        # pictures are read once and never copied as floats.
        counted = np.uint16 if factor <= _LARGEST_SHORT else np.uint32
        colours = _cell_sums(view.rgb, factor, counted)  # (3, H', W')
        depths_m = _cell_sums(measured_m, factor, np.float32)
        counts = factor**2 if whole else _cell_sums((measured_m > 0).view(np.uint8), factor, counted)
        parts = np.empty((4 if whole else 5, *depths_m.shape), np.float32)
        np.divide(colours, np.float32(255 * factor**2), out=parts[:3])
        np.subtract(depths_m, np.multiply(counts, plane_m, dtype=np.float32), out=parts[3])
        if not whole:
            parts[4] = counts
        parts[3:] /= np.float32(factor**2)
        if factor > 1:
            _smooth(parts)
        if not whole:
            # Normalised convolution: invalid pixels take part with weight zero and are filled from their neighbours.
            parts[3] /= np.maximum(parts[4], _LEAST_WEIGHT)
        channels = torch.from_numpy(parts[:4])
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


def _smooth(planes: NDArray[np.float32]) -> None:
    """[1 2 1] along both axes, edges replicated: after the mean over cells enough not to alias. (C, H, W), in place."""
    for plane in planes:
        cv2.sepFilter2D(plane, -1, _ONE_TWO_ONE, _ONE_TWO_ONE, dst=plane, borderType=cv2.BORDER_REPLICATE)
