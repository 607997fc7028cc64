"""A table with upright boxes, drawn by exact ray casting: what a hand camera sees, without PyBullet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.homography import InputGrid
from handsight.servoing.planar import PlanarPose
from handsight.servoing.view import View

CAMERA = HandCamera(
    intrinsics=Intrinsics(width=320, height=240, fx=310.0, fy=310.0, cx=159.5, cy=119.5),
    x_tool_camera_m=0.0,
    y_tool_camera_m=-0.05,
    z_tool_camera_m=-0.1,
)
TOOL_HEIGHT_M = 0.4
CAMERA_HEIGHT_M = 0.5
"""Of the camera above the table while the fingertips are at ``TOOL_HEIGHT_M``."""
GRID = InputGrid(crop_px=160, size_px=32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """Standing on the table, its sides along the axes of the base."""

    x_m: float = 0.6
    y_m: float = 0.0
    width_m: float = 0.06
    height_m: float = 0.05


def look(pose: PlanarPose, *boxes: Box) -> View:
    """The picture from a pose: the table smoothly coloured, boxes red."""
    base_camera = CAMERA.pose_base_camera(pose.pose_base_tool(TOOL_HEIGHT_M))
    k = CAMERA.intrinsics
    column, row = np.meshgrid(np.arange(k.width), np.arange(k.height))
    rays = (
        np.stack([(column - k.cx) / k.fx, (row - k.cy) / k.fy, np.ones(column.shape)], axis=-1) @ base_camera[:3, :3].T
    )
    eye = base_camera[:3, 3]
    depth_m = -eye[2] / rays[..., 2]
    point = eye + depth_m[..., None] * rays
    rgb = 128 + 90 * np.stack([np.sin(9 * point[..., 0] + 7 * point[..., 1] * n) for n in (1, -1, 0.3)], axis=-1)
    for box in boxes:
        hit_m = _hit_m(eye, rays, box)
        nearer = hit_m < depth_m
        rgb[nearer], depth_m[nearer] = (200, 30, 30), hit_m[nearer]
    return View(rgb=rgb.astype(np.uint8), depth_m=depth_m.astype(np.float32), camera=CAMERA)


def _hit_m(eye: NDArray[np.float64], rays: NDArray[np.float64], box: Box) -> NDArray[np.float64]:
    """Depth at which rays enter a box [m], infinite where they miss it (the slab method)."""
    middle = np.array([box.x_m, box.y_m, 0.5 * box.height_m])
    half = 0.5 * np.array([box.width_m, box.width_m, box.height_m])
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (middle - half - eye) / rays, (middle + half - eye) / rays
    enter = np.fmax.reduce(np.fmin(first, second), axis=-1)
    leave = np.fmin.reduce(np.fmax(first, second), axis=-1)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)
