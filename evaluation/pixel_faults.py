"""Which pixels of a predicted input the homography gets wrong, and why (section VI-E).

The homography takes everything for a plane. A pixel of the predicted input is *extrapolated* where the plane lies
outside the picture that it was made from. Of the others those are wrong at which the predicted depth is not the true
one: *occluded* where an object hid from the first picture what the second one shows, a face or the table behind it, or
hides from the second what the first one showed; *displaced* where both show the same things in another place.
Depths are compared exactly, so that this is for stations whose depth is the truth: a simulated one without noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from handsight.evaluation.level import NO_STEP, Points, before_step, inverse, on_level, pixels_of
from handsight.servoing.camera import HandCamera
from handsight.servoing.homography import InputGrid, raw_from_input
from handsight.servoing.planar import PlanarStep
from handsight.servoing.view import View

SAME_DEPTH_M = 0.005
"""Depths that differ by no more show the same surface: five steps of the depth picture, less than any object."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelFaults:
    """Shares of the pixels of one predicted input; no pixel is in two of them."""

    extrapolated: float
    """Outside the picture that the input was made from."""
    occluded: float
    """Wrong in depth because of what only one of the pictures shows."""
    displaced: float
    """Wrong in depth, though both pictures show what is meant."""


def pixel_faults(before: View, after: View, step: PlanarStep, *, grid: InputGrid) -> PixelFaults:
    """What is wrong with the input that is predicted for ``step``, held against the picture taken after it.

    Args:
        before: The picture from which is predicted.
        after: The picture taken after the step, from the same height.
        step: From the pose of the first picture to that of the second.
        grid: Crop and size of the network input.
    """
    source, truth = input_pixels(before, step, grid=grid), input_pixels(after, NO_STEP, grid=grid)
    extrapolated = ~inside(before.camera, source)
    predicted_m, true_m = _depth_m(before, source), _depth_m(after, truth)  # NaN outside and where invalid
    wrong = ~extrapolated & (np.abs(predicted_m - true_m) > SAME_DEPTH_M)
    hidden = np.zeros_like(wrong)
    hidden[wrong] = _hidden(after, truth[wrong], before, step) | _hidden(before, source[wrong], after, inverse(step))
    return PixelFaults(
        extrapolated=float(extrapolated.mean()),
        occluded=float((wrong & hidden).mean()),
        displaced=float((wrong & ~hidden).mean()),
    )


def input_pixels(view: View, step: PlanarStep, *, grid: InputGrid) -> Points:
    """Where in the raw picture the pixels of the input predicted for ``step`` lie, row by row. (size * size, 2)."""
    steps = torch.tensor([[step.dx_m, step.dy_m, step.dangle_rad]], dtype=torch.float64)
    affine = raw_from_input(view.camera, steps, plane_m=view.plane_m, view_plane_m=view.plane_m, grid=grid)[0].numpy()
    row, column = np.divmod(np.arange(grid.size_px**2), grid.size_px)
    pixels: Points = np.stack([column, row, np.ones_like(row)], axis=1) @ affine.T
    return pixels


def inside(camera: HandCamera, pixels: Points) -> Bools:
    """Which places lie within the centres of the outermost pixels, as of a ``Footprint``. (N, 2) -> (N,)."""
    last = np.array([camera.intrinsics.width - 1, camera.intrinsics.height - 1])
    return np.asarray(((pixels >= 0) & (pixels <= last)).all(axis=1))


def _hidden(view: View, pixels: Points, other: View, other_to_view: PlanarStep) -> Bools:
    """Which of the surface points at ``pixels`` of a view the other one misses though they lie in its picture. (N,).

    A point is there if a pixel beside its place has its depth: cameras of equal height measure equal depths.
    """
    depth_m = _depth_m(view, pixels)
    places = before_step(on_level(view.camera, pixels, depth_m), other_to_view)
    seen_at = pixels_of(other.camera, places, depth_m)
    found = np.zeros(len(pixels), dtype=np.bool_)
    for column in (-1, 0, 1):
        for row in (-1, 0, 1):
            found |= np.abs(_depth_m(other, seen_at + np.array([column, row])) - depth_m) <= SAME_DEPTH_M
    missed: Bools = inside(other.camera, seen_at) & ~found
    return missed


def _depth_m(view: View, pixels: Points) -> NDArray[np.float64]:
    """Depth of the nearest pixels [m]; NaN outside the picture and where depth is invalid. (N, 2) -> (N,)."""
    k = view.camera.intrinsics
    column, row = np.rint(np.nan_to_num(pixels, nan=-1.0, posinf=-1.0, neginf=-1.0)).astype(np.int64).T
    there = (column >= 0) & (column < k.width) & (row >= 0) & (row < k.height)
    depth_m = np.full(len(pixels), np.nan)
    depth_m[there] = view.depth_m[row[there], column[there]]
    depth_m[~(depth_m > 0)] = np.nan
    return depth_m
