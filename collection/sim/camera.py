"""The hand camera: objects by one of PyBullet's renderers, the table in closed form, nearest wins.

The projection is built from the intrinsics, so that principal point and focal lengths are exactly those recorded with
the dataset. Shadows are off: they more than double the time of a picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import StationSettingsError
from handsight.collection.sim.bullet import BulletClient, pybullet
from handsight.collection.sim.renderer import TINY, Renderer
from handsight.collection.sim.table import TableTop
from handsight.servoing.camera import HandCamera, Intrinsics

NEAR_M = 0.05
FAR_M = 2.0
NOTHING = 1.0 - 1e-6
"""Depth buffers hold 1 where nothing was drawn, but for rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """One distant lamp without shadows; everything is lit by ``ambient + diffuse * cos(angle to the lamp)``."""

    direction: tuple[float, float, float] = (0.3, 0.4, 1.0)
    """Towards the lamp, in the base frame; of any length."""
    ambient: float = 0.6
    """Share of a surface's colour that shows without the lamp."""
    diffuse: float = 0.35
    """Share that the lamp adds where it shines straight on the surface."""

    def __post_init__(self) -> None:
        faults = []
        if not (all(map(math.isfinite, self.direction)) and any(self.direction)):
            faults.append(f"direction is {self.direction}, expected a finite vector that is not zero")
        faults += [
            f"{name} is {value}, expected 0 to 1"
            for name, value in (("ambient", self.ambient), ("diffuse", self.diffuse))
            if not 0 <= value <= 1
        ]
        if faults:
            raise StationSettingsError(f"light: {'; '.join(faults)}")

    @property
    def on_table(self) -> float:
        """Share of its colour that a level surface shows."""
        upward = self.direction[2] / math.hypot(*self.direction)
        return self.ambient + self.diffuse * max(upward, 0.0)


DAYLIGHT = Light()
"""The light in which a table's texture shows as it is; its coefficients are PyBullet's own."""


def projection_matrix(
    intrinsics: Intrinsics, renderer: Renderer = TINY, *, far_m: float = FAR_M
) -> NDArray[np.float64]:
    """OpenGL clip matrix of a pinhole camera that sees from ``NEAR_M`` to ``far_m``. Shape (4, 4).

    Renderers differ in where they sample a pixel: OpenGL in its middle, TinyRenderer at its left and lower edge. With
    the offset taken out, views and homography agree to a twentieth of a pixel; a test shows it for both.
    """
    k = intrinsics
    right_px, down_px = renderer.sampled_px
    matrix = np.zeros((4, 4))
    matrix[0, 0] = 2 * k.fx / k.width
    matrix[0, 2] = 1 - 2 * (k.cx + right_px) / k.width
    matrix[1, 1] = 2 * k.fy / k.height
    matrix[1, 2] = 2 * (k.cy + down_px) / k.height - 1
    matrix[2, 2] = -(far_m + NEAR_M) / (far_m - NEAR_M)
    matrix[2, 3] = -2 * far_m * NEAR_M / (far_m - NEAR_M)
    matrix[3, 2] = -1.0
    return matrix


def view_matrix(pose_base_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """OpenGL view matrix (x right, y up, z backward) of a camera pose. Shape (4, 4)."""
    opengl_from_camera = np.diag([1.0, -1.0, -1.0, 1.0])
    matrix: NDArray[np.float64] = opengl_from_camera @ np.linalg.inv(pose_base_camera)
    return matrix


def render(
    bullet: BulletClient,
    table: TableTop,
    camera: HandCamera,
    pose_base_tool: NDArray[np.float64],
    *,
    depth_scale_m: float,
    light: Light = DAYLIGHT,
    renderer: Renderer = TINY,
    sense: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
    """Picture and aligned depth from the hand: (H, W, 3) u8 and (H, W) u16 in units of ``depth_scale_m``.

    Args:
        bullet: Holds the objects, and was opened for ``renderer``.
        table: What lies below them.
        camera: Intrinsics and mount.
        pose_base_tool: Where the hand is.
        depth_scale_m: Unit of depth [m].
        light: Falls on objects and table.
        renderer: Draws the objects.
        sense: What the depth sensor makes of exact depth [m], 0 where it has no answer; None for a perfect one.
    """
    pose_base_camera = camera.pose_base_camera(pose_base_tool)
    rgb, depth_m = render_objects(bullet, camera.intrinsics, pose_base_camera, light=light, renderer=renderer)
    brightness = light.on_table / DAYLIGHT.on_table
    table_rgb, table_depth_m = table.draw(camera.intrinsics, pose_base_camera, brightness=brightness)
    nearest = depth_m < table_depth_m
    table_rgb[nearest], table_depth_m[nearest] = rgb[nearest], depth_m[nearest]
    rgb, depth_m = table_rgb, table_depth_m
    if sense is not None:
        depth_m = sense(depth_m)
    np.divide(depth_m, depth_scale_m, out=depth_m)
    return rgb, np.rint(depth_m, out=depth_m).astype(np.uint16)


def render_objects(
    bullet: BulletClient,
    intrinsics: Intrinsics,
    pose_base_camera: NDArray[np.float64],
    *,
    light: Light = DAYLIGHT,
    renderer: Renderer = TINY,
    far_m: float = FAR_M,
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Picture (H, W, 3) and depth (H, W) [m] of all visible bodies; where there is none the depth is infinite."""
    k = intrinsics
    _, _, rgba, buffer, _ = bullet.getCameraImage(
        k.width,
        k.height,
        view_matrix(pose_base_camera).T.ravel().tolist(),
        projection_matrix(k, renderer, far_m=far_m).T.ravel().tolist(),
        shadow=0,
        lightDirection=renderer.lamp(light.direction),
        lightAmbientCoeff=light.ambient,
        lightDiffuseCoeff=light.diffuse,
        renderer=renderer.flag,
        flags=pybullet.ER_NO_SEGMENTATION_MASK,
    )
    nonlinear = np.reshape(buffer, (k.height, k.width))
    drawn = nonlinear < NOTHING
    depth_m = np.full(drawn.shape, np.inf)
    # Objects fill a few per cent of the picture: computing them alone saves milliseconds.
    depth_m[drawn] = far_m * NEAR_M / (far_m - (far_m - NEAR_M) * nonlinear[drawn].astype(np.float64))
    return np.reshape(rgba, (k.height, k.width, 4))[:, :, :3], depth_m
