"""Planar affine homography: the picture that the hand camera would take after a small step (section III-A, eq. 2).

With the table perpendicular to the optical axis, the homography that a planar step induces on the plane at distance Z
is an affine map. Crop, downsampling and step are composed into it, so every network input is resampled once.

Frames: pixels of the network input (column, row) -> metres on the plane in the tool frame after the step
-> metres in the tool frame now -> pixels of the raw picture. The input is centred on the grasp point, not on the
optical axis; this is what makes it symmetric under the flips of section V-A.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from handsight.servoing.camera import HandCamera
from handsight.servoing.errors import ServoSettingsError, StepError
from handsight.servoing.prepared_view import PreparedView

LARGEST_CROP_PX = 8192
"""More than any picture has: what lies beyond is a slip of digits, and padding it would take all memory."""
SAME_SCALE = 0.05
"""Scales that differ by less are one: the table's distance is measured in every picture, as its mean depth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InputGrid:
    """The network's view of the raw picture: a centred square crop, downsampled (section III-B)."""

    crop_px: int = 400
    """Side of the crop, in raw pixels of the pre-grasp view."""
    size_px: int = 64
    """Side of the network's input."""
    span_m: float | None = None
    """Side of the crop on the table in the pictures that the network was trained on [m]: pictures from another height,
    or of another camera, are made to show as much. None where it is not known, or pictures are taken as they are."""

    def __post_init__(self) -> None:
        sides: tuple[object, ...] = (self.crop_px, self.size_px)  # Perhaps from a file.
        whole = all(isinstance(px, int) and not isinstance(px, bool) for px in sides)
        if not (whole and 1 < self.size_px <= self.crop_px <= LARGEST_CROP_PX):
            raise ServoSettingsError(
                f"input grid is {self.size_px!r} px from a {self.crop_px!r} px crop, expected whole numbers with "
                f"1 < size <= crop <= {LARGEST_CROP_PX}"
            )
        if self.span_m is not None and not (math.isfinite(self.span_m) and self.span_m > 0):
            raise ServoSettingsError(f"input grid spans {self.span_m} m, expected a positive length or None")

    def to_json(self) -> dict[str, Any]:
        """As JSON values; without a span where it is not known, as older records have it."""
        span = {} if self.span_m is None else {"span_m": self.span_m}
        return {"crop_px": self.crop_px, "size_px": self.size_px, **span}

    @property
    def pixels_per_cell(self) -> int:
        """Decimation that leaves about two filtered pixels per input pixel: no aliasing, little to read."""
        return max(1, round(self.crop_px / self.size_px / 2))


def judged_from_m(camera: HandCamera, grid: InputGrid, view_plane_m: float) -> float:
    """Distance of the plane from which a network judges [m].

    Args:
        camera: The camera that took the picture.
        grid: The network's.
        view_plane_m: Distance of the plane where the picture is to be predicted [m].

    Returns:
        ``view_plane_m``, unless from there an input would show more or less of the table than the network was trained
        on; then the distance from which it shows as much.
    """
    if grid.span_m is None:
        return view_plane_m
    wanted_m = grid.span_m * camera.intrinsics.fx / grid.crop_px
    return view_plane_m if abs(wanted_m / view_plane_m - 1) < SAME_SCALE else wanted_m


def raw_from_input(
    camera: HandCamera, steps: Tensor, *, plane_m: float, view_plane_m: float, grid: InputGrid
) -> Tensor:
    """Affine maps from network input pixels to raw pixels, one per step.

    Args:
        camera: The camera that took the picture.
        steps: Delta poses (dx [m], dy [m], dangle [rad]) in the current tool frame. Shape (B, 3).
        plane_m: Distance of the plane in the picture taken [m].
        view_plane_m: Distance of the plane in the picture to predict [m]; differs when the camera also changes height.
        grid: Crop and size of the network input.

    Returns:
        Maps M with raw = M @ (column, row, 1). Shape (B, 2, 3).
    """
    k = camera.intrinsics
    focal = steps.new_tensor([k.fx, k.fy])
    centre = steps.new_tensor([k.cx, k.cy])
    camera_offset_m = steps.new_tensor([camera.x_tool_camera_m, camera.y_tool_camera_m])
    # Input pixel -> metres around the grasp point: the crop's pixels are those of a camera at this distance.
    judged_m = judged_from_m(camera, grid, view_plane_m)
    metres_per_pixel = grid.crop_px / grid.size_px * judged_m / focal  # (2,)
    cos, sin = torch.cos(steps[:, 2]), torch.sin(steps[:, 2])
    turn = torch.stack([torch.stack([cos, -sin], -1), torch.stack([sin, cos], -1)], -2)  # (B, 2, 2)
    linear = (focal / plane_m)[:, None] * turn * metres_per_pixel  # (B, 2, 2)
    grasp_px = focal / plane_m * (steps[:, :2] - camera_offset_m) + centre  # (B, 2)
    middle = 0.5 * (grid.size_px - 1)
    offset = grasp_px - linear.sum(-1) * middle
    return torch.cat([linear, offset[:, :, None]], -1)


def predict_inputs(
    view: PreparedView,
    steps: Tensor,
    *,
    grid: InputGrid,
    view_plane_m: float | None = None,
    side_px: int | None = None,
) -> Tensor:
    """Network inputs predicted for every step: f(I_p, dp) of eq. 2. Edges are replicated.

    Args:
        view: The prepared picture I_p.
        steps: Delta poses in the current tool frame, (dx [m], dy [m], dangle [rad]). Shape (B, 3).
        grid: Crop and size of the network input.
        view_plane_m: Distance of the plane in the predicted picture; None means the height does not change.
        side_px: So many rows and columns of each, from the first; None for all of them.

    Returns:
        Red, green, blue in [0, 1] and height below the plane [m], on the steps' device and in their precision; steps
        that require a gradient get one. Shape (B, 4, side, side).

    Raises:
        StepError: The steps have another shape or type.
    """
    _check_steps(steps)
    plane_m = view.plane_m if view_plane_m is None else view_plane_m
    maps = raw_from_input(view.camera, steps, plane_m=view.plane_m, view_plane_m=plane_m, grid=grid)
    side_px = side_px or grid.size_px
    return _resampled(view, maps, width_px=side_px, height_px=side_px)


def predict_picture(
    view: PreparedView,
    step: Tensor,
    *,
    grid: InputGrid,
    width_px: int,
    height_px: int,
    view_plane_m: float | None = None,
) -> Tensor:
    """A picture larger than a network input whose every crop is the input of a step; edges are replicated.

    The crop that begins at (row, column) is the input predicted for ``step`` moved by so many network pixels along the
    axes of the turned tool.

    Args:
        view: The prepared picture.
        step: The step whose input is the picture's first crop, (dx [m], dy [m], dangle [rad]). Shape (3,).
        grid: Crop and size of the network input.
        width_px: Columns of the picture, in network pixels.
        height_px: Its rows.
        view_plane_m: Distance of the plane in the predicted picture; None means the height does not change.

    Returns:
        Channels as of :func:`predict_inputs`. Shape (4, height, width).

    Raises:
        StepError: The step has another shape or type.
    """
    _check_steps(step[None])
    plane_m = view.plane_m if view_plane_m is None else view_plane_m
    maps = raw_from_input(view.camera, step[None], plane_m=view.plane_m, view_plane_m=plane_m, grid=grid)
    return _resampled(view, maps, width_px=width_px, height_px=height_px)[0]


def _resampled(view: PreparedView, maps: Tensor, *, width_px: int, height_px: int) -> Tensor:
    """The view's channels where maps from network to raw pixels say. (B, 2, 3) -> (B, 4, height, width)."""
    cell = view.pixels_per_cell
    channels, height, width = view.channels.shape
    # Raw pixel -> decimated pixel -> [-1, 1]; the centre of cell i is at raw pixel cell * i + (cell - 1) / 2.
    scale = 2 / (maps.new_tensor([width, height]) - 1)
    maps = maps * (scale / cell)[:, None]
    maps[:, :, 2] -= 0.5 * (cell - 1) / cell * scale + 1
    columns = torch.arange(width_px, dtype=maps.dtype, device=maps.device)
    rows = torch.arange(height_px, dtype=maps.dtype, device=maps.device)
    column = maps[:, :, 0, None] * columns  # (B, 2, width)
    row = maps[:, :, 1, None] * rows + maps[:, :, 2, None]  # (B, 2, height)
    points = (row[:, :, :, None] + column[:, :, None, :]).permute(0, 2, 3, 1)  # (B, row, column, 2)
    # One tall picture instead of a batch of copies: all samples read the same source.
    batch = len(maps)
    sampled = functional.grid_sample(
        view.channels[None].to(points),
        points.reshape(1, batch * height_px, width_px, 2),
        padding_mode="border",
        align_corners=True,
    )
    return sampled.reshape(channels, batch, height_px, width_px).transpose(0, 1).contiguous()


def _check_steps(steps: Tensor) -> None:
    # Half precision cannot tell neighbouring pixels apart at the far side of a picture.
    if steps.dtype not in (torch.float32, torch.float64) or steps.ndim != 2 or steps.shape[1] != 3:
        raise StepError(
            f"steps are {steps.dtype} of shape {tuple(steps.shape)}, expected torch.float32 or torch.float64 of shape "
            "(B, 3): dx [m], dy [m], dangle [rad]"
        )
