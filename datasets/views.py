"""A recorded picture as the servoing room sees it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from handsight.datasets.records import RgbdFrame, StationSpec
from handsight.servoing.view import View

if TYPE_CHECKING:
    # PyTorch takes seconds, and whoever draws a picture needs none.
    from handsight.servoing.homography import InputGrid

_LEAST_ZOOM = 0.3
"""Share of its distance below which no picture is looked at from nearer."""


def station_view(frame: RgbdFrame, station: StationSpec) -> View:
    """A recorded picture as the servoing room sees it: depth in metres."""
    depth_m = frame.depth.astype(np.float32) * np.float32(station.depth_scale_m)
    return View(rgb=frame.rgb, depth_m=depth_m, camera=station.camera)


def input_span_m(station: StationSpec, grid: InputGrid) -> float | None:
    """Side of a network input on the table, as seen from where a station's grasps begin [m].

    Returns:
        None where the camera cannot be there, as of some foreign set that does not say where it was.
    """
    plane_m = station.pregrasp_height_m - station.camera.z_tool_camera_m
    return grid.crop_px * plane_m / station.camera.intrinsics.fx if plane_m > 0 else None


def grasp_plane_m(view: View, frame: RgbdFrame, station: StationSpec) -> float | None:
    """Distance of the plane from where a network judges [m]: from the height at which grasps begin.

    Overhead pictures are taken above it, and inputs are made as they would be seen from there.

    Returns:
        None where the heights recorded cannot be those of the picture, which is then judged as it is.

    Raises:
        ImageError: No pixel has a valid depth.
    """
    plane_m = view.plane_m - (float(frame.pose_base_tool[2, 3]) - station.pregrasp_height_m)
    return plane_m if _LEAST_ZOOM < plane_m / view.plane_m < 1 / _LEAST_ZOOM else None
