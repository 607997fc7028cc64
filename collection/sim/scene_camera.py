"""A camera beside the table, for people: the whole arm, the table and the objects in one picture.

TinyRenderer draws the bodies, the table is drawn in closed form as for the hand camera, and so is what TinyRenderer
cannot do: the shadow that everything casts on the table. It is the lamp's own view of the bodies, a mask, carried over
to the picture by the homography that the table induces between the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import StationSettingsError
from handsight.collection.sim.camera import Light, render_objects
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.static_replica import StaticReplica
from handsight.collection.sim.table import TABLE_CENTRE_M, TABLE_HALF_SIZE_M, TableTop, plane_depth_m, table_homography
from handsight.datasets.records import SceneObjects
from handsight.servoing.camera import Intrinsics

FAR_M = 12.0
SAMPLES = 2
"""Each pixel is the mean of so many by so many samples: the renderer leaves edges jagged."""
LAMP_M = (1.5, 1.3, 2.6)
LAMP_TARGET_M = (0.45, 0.0, 0.2)
LAMP_PICTURE = Intrinsics.from_vertical_fov(width=900, height=900, fov_y_rad=math.radians(48))
SHADOW_DEPTH = 0.38
"""Share of the light on the table that the lamp gives."""
SHADOW_BLUR_PX = 9
SKY_RGB = ((0.97, 0.98, 0.99), (0.80, 0.83, 0.86))
"""Background at the top and at the bottom of the picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Viewpoint:
    """Where the scene camera stands, and what it looks at."""

    eye_m: tuple[float, float, float] = (1.80, 1.50, 1.10)
    """In the base frame."""
    target_m: tuple[float, float, float] = (0.42, -0.02, 0.32)
    """The middle of the picture, in the base frame."""
    fov_y_rad: float = math.radians(33)
    width: int = 960
    height: int = 720

    def __post_init__(self) -> None:
        faults = []
        if math.dist(self.eye_m[:2], self.target_m[:2]) < 1e-6:
            faults.append(f"eye {self.eye_m} is straight above or below the target {self.target_m}")
        if self.eye_m[2] <= 0:
            faults.append(f"eye {self.eye_m} is not above the table")
        if not 0 < self.fov_y_rad < math.pi:
            faults.append(f"field of view is {self.fov_y_rad} rad, expected between 0 and pi")
        if self.width < 1 or self.height < 1:
            faults.append(f"size is {self.width}x{self.height}, expected at least 1x1")
        if faults:
            raise StationSettingsError(f"viewpoint: {'; '.join(faults)}")

    @property
    def pose_base_camera(self) -> NDArray[np.float64]:
        """Camera frame (x right, y down, z forward) in the base frame. Shape (4, 4)."""
        return pose_looking_at(self.eye_m, self.target_m)


class SceneCamera:
    """Takes pictures of a replica; the world of the attempt is not involved."""

    def __init__(self, config: SimConfig, table: TableTop, viewpoint: Viewpoint | None = None) -> None:
        """Load arm and table with their visual meshes, which takes half a second.

        Raises:
            ObjectSetError: Unknown object set.
        """
        self._viewpoint = viewpoint or Viewpoint()
        self._table = table
        self._replica = StaticReplica(config)

    def picture(self, pose_base_tool: NDArray[np.float64], width_m: float, scene: SceneObjects) -> NDArray[np.uint8]:
        """The station from outside. Shape (H, W, 3).

        Args:
            pose_base_tool: Tool frame in the base frame. Shape (4, 4).
            width_m: Opening between the jaws [m].
            scene: The objects and where they lie, of the object set that the camera was made for.

        Raises:
            UnreachableError: The arm cannot stand like this.
        """
        self._replica.arrange(pose_base_tool, width_m, scene)
        view = self._viewpoint
        fine = Intrinsics.from_vertical_fov(
            width=SAMPLES * view.width, height=SAMPLES * view.height, fov_y_rad=view.fov_y_rad
        )
        rgb = self._draw(fine, view.pose_base_camera)
        return np.asarray(cv2.resize(rgb, (view.width, view.height), interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def _draw(self, intrinsics: Intrinsics, pose_base_camera: NDArray[np.float64]) -> NDArray[np.uint8]:
        lamp = pose_looking_at(LAMP_M, LAMP_TARGET_M)
        x, y, z = (-lamp[:3, 2]).tolist()
        light = Light(direction=(x, y, z))
        bodies_rgb, bodies_m = render_objects(
            self._replica.bullet, intrinsics, pose_base_camera, light=light, far_m=FAR_M
        )
        table_rgb, _ = self._table.draw(intrinsics, pose_base_camera)
        lit = 1.0 - SHADOW_DEPTH * self._shadow(intrinsics, pose_base_camera)
        table_m = _table_depth_m(intrinsics, pose_base_camera)
        rgb = np.where(np.isfinite(table_m)[..., None], table_rgb * lit[..., None], _sky(intrinsics))
        return np.where((bodies_m < table_m)[..., None], bodies_rgb, rgb).astype(np.uint8)

    def _shadow(self, intrinsics: Intrinsics, pose_base_camera: NDArray[np.float64]) -> NDArray[np.float32]:
        """Share of the lamp that something keeps from the table, at every pixel. Shape (H, W)."""
        pose_base_lamp = pose_looking_at(LAMP_M, LAMP_TARGET_M)
        _, depth_m = render_objects(self._replica.bullet, LAMP_PICTURE, pose_base_lamp, far_m=FAR_M)
        mask = (depth_m < plane_depth_m(LAMP_PICTURE, pose_base_lamp)).astype(np.float32)
        soft = cv2.GaussianBlur(mask, (SHADOW_BLUR_PX, SHADOW_BLUR_PX), 0)
        lamp_from_pixel = table_homography(LAMP_PICTURE, pose_base_lamp) @ np.linalg.inv(
            table_homography(intrinsics, pose_base_camera)
        )
        size = (intrinsics.width, intrinsics.height)
        return np.asarray(
            cv2.warpPerspective(soft, lamp_from_pixel, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP),
            dtype=np.float32,
        )

    def close(self) -> None:
        """Let go of the replica."""
        self._replica.close()


def pose_looking_at(eye_m: tuple[float, float, float], target_m: tuple[float, float, float]) -> NDArray[np.float64]:
    """Pose of an upright camera (x right, y down, z forward) in the base frame. Shape (4, 4)."""
    forward = np.subtract(target_m, eye_m)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye_m
    return pose


def _table_depth_m(intrinsics: Intrinsics, pose_base_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth of the table top at every pixel [m]; infinite beside it. Shape (H, W)."""
    depth_m = plane_depth_m(intrinsics, pose_base_camera)
    row, column = np.mgrid[0 : intrinsics.height, 0 : intrinsics.width]
    pixels = np.stack([column, row, np.ones_like(row)], axis=-1)  # (H, W, 3)
    homogeneous = pixels @ np.linalg.inv(table_homography(intrinsics, pose_base_camera)).T
    offset_m = np.abs(homogeneous[..., :2] / homogeneous[..., 2:] - TABLE_CENTRE_M)
    on_table = (depth_m > 0) & (offset_m <= TABLE_HALF_SIZE_M).all(axis=-1)
    return np.where(on_table, depth_m, np.inf)


def _sky(intrinsics: Intrinsics) -> NDArray[np.float64]:
    """The background: grey that darkens downwards. Shape (H, 1, 3)."""
    share = np.linspace(0.0, 1.0, intrinsics.height)[:, None, None]
    top, bottom = np.array(SKY_RGB)
    sky: NDArray[np.float64] = 255 * ((1 - share) * top + share * bottom)
    return sky
