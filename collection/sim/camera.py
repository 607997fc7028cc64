"""The hand camera: objects by PyBullet's software renderer, the table in closed form, nearest wins.

The projection is built from the intrinsics, so that principal point and focal lengths are exactly those recorded with
the dataset. Shadows are off: they more than double the time of a picture.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.engine import BulletClient, pybullet
from handsight.collection.sim.table import TableTop
from handsight.servoing.camera import HandCamera, Intrinsics

NEAR_M = 0.05
FAR_M = 2.0
LIGHT_DIRECTION = (0.3, 0.4, 1.0)


def projection_matrix(intrinsics: Intrinsics) -> NDArray[np.float64]:
    """OpenGL clip matrix of a pinhole camera. Shape (4, 4).

    OpenGL samples pixels half way between their edges; this renderer samples them at their left and lower edge, which
    is where the offsets of 0 and 1 come from. With them, views and homography agree to a twentieth of a pixel; a test
    shows it.
    """
    k = intrinsics
    matrix = np.zeros((4, 4))
    matrix[0, 0] = 2 * k.fx / k.width
    matrix[0, 2] = 1 - 2 * k.cx / k.width
    matrix[1, 1] = 2 * k.fy / k.height
    matrix[1, 2] = 2 * (k.cy + 1) / k.height - 1
    matrix[2, 2] = -(FAR_M + NEAR_M) / (FAR_M - NEAR_M)
    matrix[2, 3] = -2 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
    matrix[3, 2] = -1.0
    return matrix


def camera_pose(camera: HandCamera, pose_base_tool: NDArray[np.float64]) -> NDArray[np.float64]:
    """Camera frame (x right, y down, z forward) in the base frame. Shape (4, 4)."""
    pose_tool_camera = np.eye(4)
    pose_tool_camera[:3, 3] = camera.x_tool_camera_m, camera.y_tool_camera_m, camera.z_tool_camera_m
    pose: NDArray[np.float64] = pose_base_tool @ pose_tool_camera
    return pose


def view_matrix(pose_base_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """OpenGL view matrix (x right, y up, z backward) of a camera pose. Shape (4, 4)."""
    opengl_from_camera = np.diag([1.0, -1.0, -1.0, 1.0])
    matrix: NDArray[np.float64] = opengl_from_camera @ np.linalg.inv(pose_base_camera)
    return matrix


def render(
    engine: BulletClient,
    table: TableTop,
    camera: HandCamera,
    pose_base_tool: NDArray[np.float64],
    *,
    depth_scale_m: float,
) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
    """Picture and aligned depth from the hand: (H, W, 3) u8 and (H, W) u16 in units of ``depth_scale_m``."""
    pose_base_camera = camera_pose(camera, pose_base_tool)
    rgb, depth_m = render_objects(engine, camera.intrinsics, pose_base_camera)
    table_rgb, table_depth_m = table.draw(camera.intrinsics, pose_base_camera)
    nearest = depth_m < table_depth_m
    rgb = np.where(nearest[:, :, None], rgb, table_rgb)
    depth = np.rint(np.where(nearest, depth_m, table_depth_m) / depth_scale_m)
    return rgb, depth.astype(np.uint16)


def render_objects(
    engine: BulletClient, intrinsics: Intrinsics, pose_base_camera: NDArray[np.float64]
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Picture (H, W, 3) and depth (H, W) [m] of all visible bodies; where there is none the depth is infinite."""
    k = intrinsics
    _, _, rgba, buffer, _ = engine.getCameraImage(
        k.width,
        k.height,
        view_matrix(pose_base_camera).T.ravel().tolist(),
        projection_matrix(k).T.ravel().tolist(),
        shadow=0,
        lightDirection=LIGHT_DIRECTION,
        renderer=pybullet.ER_TINY_RENDERER,
        flags=pybullet.ER_NO_SEGMENTATION_MASK,
    )
    rgb = np.reshape(rgba, (k.height, k.width, 4))[:, :, :3].astype(np.uint8)
    nonlinear = np.reshape(buffer, (k.height, k.width)).astype(np.float64)
    depth_m = FAR_M * NEAR_M / (FAR_M - (FAR_M - NEAR_M) * nonlinear)
    return rgb, np.where(nonlinear < 1.0, depth_m, np.inf)
