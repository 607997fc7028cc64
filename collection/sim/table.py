"""The table: a solid box below z = 0 for physics, and its wooden top drawn in closed form for the camera.

A plane needs no rasteriser: its picture is the texture under the homography between table and image plane, its depth
follows from one ray-plane intersection per pixel. This is four times faster than letting the software renderer fill
the picture with table, free of its texture aliasing, and exact; a test compares both.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.bullet import BulletClient, pybullet
from handsight.servoing.camera import Intrinsics

TABLE_HALF_SIZE_M = 0.8
TABLE_THICKNESS_M = 0.1
TABLE_CENTRE_M = (0.65, 0.0)
TABLE_FRICTION = 0.7
TEXTURE_PX = 1024
WOOD_RGB = (176.0, 137.0, 96.0)


def add_table(bullet: BulletClient, *, friction: float = TABLE_FRICTION) -> int:
    """Add the table to an bullet, for contact only, and return its body."""
    half_size = (TABLE_HALF_SIZE_M, TABLE_HALF_SIZE_M, 0.5 * TABLE_THICKNESS_M)
    solid = bullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half_size)
    # Without a visual shape of its own PyBullet would draw the collision shape; a dummy visual inside it is unseen.
    dummy_visual = bullet.createVisualShape(pybullet.GEOM_SPHERE, radius=1e-4)
    body: int = bullet.createMultiBody(0, solid, dummy_visual, (*TABLE_CENTRE_M, -0.5 * TABLE_THICKNESS_M))
    bullet.changeDynamics(body, -1, lateralFriction=friction)
    return body


@dataclass(frozen=True, slots=True)
class TableTop:
    """A textured plane at z = 0, continued by reflection beyond the edges of its texture."""

    texture: NDArray[np.uint8]
    """RGB; columns run along the base's x axis, rows along its y axis. Shape (T, T, 3)."""
    size_m: float
    """Side of the square that the texture covers, centred on the table."""

    def draw(
        self, intrinsics: Intrinsics, pose_base_camera: NDArray[np.float64], *, brightness: float = 1.0
    ) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
        """Picture (H, W, 3) u8 and depth along the optical axis (H, W) [m] of the plane, as the camera sees it.

        ``brightness`` is a factor on the texture's colours, which stop at white.
        """
        homography = self._texture_from_pixel(intrinsics, pose_base_camera)
        size = (intrinsics.width, intrinsics.height)
        rgb = cv2.warpPerspective(
            self.texture, homography, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_REFLECT
        )
        if brightness != 1.0:
            rgb = cv2.convertScaleAbs(rgb, alpha=brightness)
        return np.asarray(rgb, dtype=np.uint8), plane_depth_m(intrinsics, pose_base_camera)

    def _texture_from_pixel(self, intrinsics: Intrinsics, pose_base_camera: NDArray[np.float64]) -> NDArray[np.float64]:
        """Homography from homogeneous pixels to homogeneous texture coordinates. Shape (3, 3)."""
        pixel_from_table = table_homography(intrinsics, pose_base_camera)
        pixels_per_m = len(self.texture) / self.size_m
        origin_px = 0.5 * (len(self.texture) - 1)
        texture_from_table = np.array(
            [
                [pixels_per_m, 0, origin_px - pixels_per_m * TABLE_CENTRE_M[0]],
                [0, pixels_per_m, origin_px - pixels_per_m * TABLE_CENTRE_M[1]],
                [0, 0, 1],
            ]
        )
        homography: NDArray[np.float64] = texture_from_table @ np.linalg.inv(pixel_from_table)
        return homography


def table_homography(intrinsics: Intrinsics, pose_base_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """From homogeneous points (x, y, 1) [m] of the table, in the base frame, to homogeneous pixels. Shape (3, 3)."""
    pose_camera_base = np.linalg.inv(pose_base_camera)
    # On z = 0 the third column of the rotation drops out (Hartley & Zisserman, section 8.1).
    homography: NDArray[np.float64] = intrinsics.matrix() @ pose_camera_base[:3, [0, 1, 3]]
    return homography


def plane_depth_m(intrinsics: Intrinsics, pose_base_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth of the plane z = 0 along the optical axis of every pixel [m]. Shape (H, W)."""
    x = (np.arange(intrinsics.width) - intrinsics.cx) / intrinsics.fx  # (W,)
    y = (np.arange(intrinsics.height) - intrinsics.cy) / intrinsics.fy  # (H,)
    down = pose_base_camera[2, :3]
    # A point at depth d along ray (x, y, 1) has base height pose[2, 3] + d * (down . ray).
    slope = down[0] * x[None, :] + down[1] * y[:, None] + down[2]
    depth_m: NDArray[np.float64] = -pose_base_camera[2, 3] / slope
    return depth_m


def wooden_table(rng: np.random.Generator) -> TableTop:
    """Faintly grained brown boards, like the table of the paper's experiments."""
    grain = rng.normal(size=(TEXTURE_PX // 8, TEXTURE_PX // 128)).astype(np.float32)
    streaks = cv2.resize(grain, (TEXTURE_PX, TEXTURE_PX), interpolation=cv2.INTER_CUBIC)
    boards = np.repeat(rng.normal(scale=0.6, size=16), TEXTURE_PX // 16)[:, None]
    shade = 1.0 + 0.05 * (streaks + boards)
    texture = np.clip(shade[:, :, None] * np.array(WOOD_RGB), 0, 255).astype(np.uint8)
    return TableTop(texture, size_m=2 * TABLE_HALF_SIZE_M)
