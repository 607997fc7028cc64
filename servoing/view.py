"""What the hand camera sees at one pose, prepared once so that many warps of it are cheap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from handsight.servoing.camera import HandCamera
from handsight.servoing.errors import ImageError


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """One aligned RGB-D picture and the camera that took it."""

    rgb: NDArray[np.uint8]
    """Shape (H, W, 3)."""
    depth_m: NDArray[np.float32]
    """Distance along the optical axis [m]; 0 or NaN is invalid. Shape (H, W)."""
    camera: HandCamera

    def __post_init__(self) -> None:
        k = self.camera.intrinsics
        faults = []
        if self.rgb.shape != (k.height, k.width, 3) or self.rgb.dtype != np.uint8:
            faults.append(f"rgb is {self.rgb.dtype} {self.rgb.shape}, expected uint8 {(k.height, k.width, 3)}")
        if self.depth_m.shape != (k.height, k.width):
            faults.append(f"depth has shape {self.depth_m.shape}, expected {(k.height, k.width)}")
        if faults:
            raise ImageError("; ".join(faults))

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where depth was measured. Shape (H, W)."""
        return np.isfinite(self.depth_m) & (self.depth_m > 0)

    @property
    def plane_m(self) -> float:
        """Distance of the plane on which everything is assumed to lie: the mean valid depth (section III-A) [m].

        Raises:
            ImageError: No pixel has a valid depth.
        """
        valid = self.valid
        if not valid.any():
            raise ImageError("no pixel of the depth picture is valid, expected at least one; check the camera")
        return float(np.mean(self.depth_m, where=valid, dtype=np.float64))


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
        plane_m = view.plane_m
        valid = torch.from_numpy(view.valid).to(torch.float32)  # (H, W)
        below_plane_m = torch.from_numpy(np.where(view.valid, view.depth_m - plane_m, 0.0).astype(np.float32))
        rgb = torch.from_numpy(view.rgb).permute(2, 0, 1).to(torch.float32) / 255  # (3, H, W)
        stack = torch.cat([rgb, below_plane_m[None], valid[None]])  # (5, H, W)
        if pixels_per_cell > 1:
            stack = _decimate(stack, pixels_per_cell)
        # Normalised convolution: invalid pixels take part with weight zero and are filled from their neighbours.
        depth = torch.where(stack[4] > 0, stack[3] / stack[4].clamp_min(1e-6), 0.0)
        channels = torch.cat([stack[:3], depth[None]])
        return cls(channels=channels, pixels_per_cell=pixels_per_cell, plane_m=plane_m, camera=view.camera)


def _decimate(stack: Tensor, factor: int) -> Tensor:
    """Mean over factor x factor cells, then a [1 2 1] smoothing; edges are replicated. (C, H, W) -> (C, H', W')."""
    _, height, width = stack.shape
    padded = functional.pad(stack[None], (0, -width % factor, 0, -height % factor), mode="replicate")
    cells = functional.pad(functional.avg_pool2d(padded, factor), (1, 1, 1, 1), mode="replicate")[0]
    rows = 0.25 * cells[:, :-2] + 0.5 * cells[:, 1:-1] + 0.25 * cells[:, 2:]
    return 0.25 * rows[:, :, :-2] + 0.5 * rows[:, :, 1:-1] + 0.25 * rows[:, :, 2:]
