"""Points that pixels of a level camera show, and where they are after a planar step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handsight.servoing.camera import HandCamera
from handsight.servoing.planar import PlanarPose, PlanarStep

Points = NDArray[np.float64]
"""Places in a raw picture (column, row) [px], or on a level (x, y) [m]. Shape (N, 2)."""

NO_STEP = PlanarStep(dx_m=0.0, dy_m=0.0, dangle_rad=0.0)
_HERE = PlanarPose(x_m=0.0, y_m=0.0, angle_rad=0.0)


def inverse(step: PlanarStep) -> PlanarStep:
    """The step that leads back."""
    return _HERE.after(step).step_to(_HERE)


def on_level(camera: HandCamera, pixels: Points, depth_m: NDArray[np.float64]) -> Points:
    """The points that pixels show, in the tool frame and without their height [m]. (N, 2), (N,) -> (N, 2)."""
    k = camera.intrinsics
    offset_m = np.array([camera.x_tool_camera_m, camera.y_tool_camera_m])
    places: Points = (pixels - (k.cx, k.cy)) / (k.fx, k.fy) * depth_m[:, None] + offset_m
    return places


def pixels_of(camera: HandCamera, places: Points, depth_m: NDArray[np.float64]) -> Points:
    """The inverse of :func:`on_level`."""
    k = camera.intrinsics
    offset_m = np.array([camera.x_tool_camera_m, camera.y_tool_camera_m])
    pixels: Points = (places - offset_m) / depth_m[:, None] * (k.fx, k.fy) + (k.cx, k.cy)
    return pixels


def before_step(places: Points, step: PlanarStep) -> Points:
    """Points in the tool frame after a step, in the frame before it [m]. (N, 2) -> (N, 2)."""
    cos, sin = np.cos(step.dangle_rad), np.sin(step.dangle_rad)
    turned: Points = places @ np.array([[cos, sin], [-sin, cos]]) + (step.dx_m, step.dy_m)
    return turned
