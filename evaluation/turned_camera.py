"""The picture that a camera would have taken had it been turned about its centre.

A turn about the centre of a pinhole camera moves every pixel by one homography, K R K^-1, however far away what it
shows is (Hartley & Zisserman, section 8.4.2): nothing hides behind anything else than before. Depth is measured along
the optical axis, which turns too, so that it changes by a factor that the pixel alone decides.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handsight.datasets.records import RgbdFrame
from handsight.servoing.camera import Intrinsics


def random_turn(angle_rad: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """A turn by an angle about an axis that is uniform over all directions. Shape (3, 3)."""
    axis = rng.normal(size=3)
    rotation: NDArray[np.float64] = Rotation.from_rotvec(angle_rad * axis / np.linalg.norm(axis)).as_matrix()
    return rotation


def turned_frame(frame: RgbdFrame, intrinsics: Intrinsics, turned_from_camera: NDArray[np.float64]) -> RgbdFrame:
    """A frame as the turned camera would have taken it from the same place.

    What lies outside the frame is unknown: such pixels take the colour of its edge, and have no depth.

    Args:
        frame: As it was taken.
        intrinsics: Of the camera, which both share.
        turned_from_camera: Rotation that takes directions from the camera's axes (x right, y down, z forward) to the
            axes of the turned camera. Shape (3, 3).
    """
    k = intrinsics
    x = (np.arange(k.width) - k.cx) / k.fx  # (W,)
    y = (np.arange(k.height) - k.cy) / k.fy  # (H,)
    turned_rays = np.stack([*np.meshgrid(x, y), np.ones((k.height, k.width))], axis=-1)  # (H, W, 3)
    rays = turned_rays @ turned_from_camera  # Each is R^T r: the same ray, in the axes of the camera as it was.
    forward = rays[..., 2]
    before = forward > 0
    share = rays[..., :2] / np.where(before, forward, 1.0)[..., None]
    column, row = k.fx * share[..., 0] + k.cx, k.fy * share[..., 1] + k.cy
    shown = before & _within(column, k.width) & _within(row, k.height)
    maps = column.astype(np.float32), row.astype(np.float32)
    rgb = cv2.remap(frame.rgb, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    # Depth is not mixed across edges: between an object and the table there is nothing.
    depth = cv2.remap(frame.depth, *maps, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    # A point at depth d on the ray r is d / r_z of it away, and the turned ray's third coordinate is 1.
    turned_depth = np.rint(np.where(shown, depth / np.where(before, forward, 1.0), 0.0))
    largest = np.iinfo(frame.depth.dtype).max
    return replace(
        frame,
        rgb=np.asarray(rgb, dtype=np.uint8),
        depth=np.minimum(turned_depth, largest).astype(frame.depth.dtype),
    )


def _within(coordinate: NDArray[np.float64], pixels: int) -> NDArray[np.bool_]:
    """Whether coordinates along one axis are on the picture, whose outer pixels reach half a pixel beyond centres."""
    inside: NDArray[np.bool_] = (coordinate >= -0.5) & (coordinate < pixels - 0.5)
    return inside
