"""Pictures of a textured plane and the shift between two of them: views are held against the homography with these."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.camera import render_objects
from handsight.collection.sim.renderer import TINY, Renderer
from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.homography import InputGrid
from handsight.servoing.planar import PlanarPose
from handsight.servoing.prepared_view import PreparedView
from handsight.servoing.view import View

HEIGHT_M = 0.4
FULL = InputGrid(crop_px=300, size_px=300)
"""No downsampling: every pixel of the prediction counts."""
INNER = slice(75, 225)
"""Of each axis; the border is extrapolated for large steps."""
SKEWED = HandCamera(
    intrinsics=Intrinsics(width=640, height=480, fx=600.0, fy=600.0, cx=301.0, cy=255.0),
    x_tool_camera_m=0.02,
    y_tool_camera_m=-0.03,
    z_tool_camera_m=-0.12,
)
"""Off-centre in every way, so that no mistake of sign or offset can hide in a zero."""


def write_textured_square(folder: Path, half_m: float = 0.5) -> Path:
    """A square in z = 0 with a smooth random texture, as a mesh with its material."""
    noise = np.random.default_rng(0).uniform(0, 255, (128, 128, 3)).astype(np.uint8)
    cv2.imwrite(str(folder / "noise.png"), cv2.resize(noise, (2048, 2048), interpolation=cv2.INTER_CUBIC))
    (folder / "noise.mtl").write_text("newmtl noise\nKd 1 1 1\nmap_Kd noise.png\n", encoding="utf-8")
    corners = [(-half_m, -half_m), (half_m, -half_m), (half_m, half_m), (-half_m, half_m)]
    lines = ["mtllib noise.mtl", "usemtl noise", *(f"v {x} {y} 0" for x, y in corners)]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "vn 0 0 1", "f 1/1/1 2/2/1 3/3/1", "f 1/1/1 3/3/1 4/4/1"]
    path = folder / "square.obj"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def look(
    bullet: BulletClient,
    camera: HandCamera,
    pose: PlanarPose,
    *,
    height_m: float = HEIGHT_M,
    renderer: Renderer = TINY,
) -> PreparedView:
    """What the camera sees from a pose, every pixel of it."""
    pose_base_camera = camera.pose_base_camera(pose.pose_base_tool(height_m))
    rgb, depth_m = render_objects(bullet, camera.intrinsics, pose_base_camera, renderer=renderer)
    view = View(rgb=rgb, depth_m=depth_m.astype(np.float32), camera=camera)
    return PreparedView.from_view(view, pixels_per_cell=1)


def shift_px(predicted: NDArray[np.float32], seen: NDArray[np.float32]) -> float:
    """Least-squares translation between two nearly aligned pictures, after Lucas and Kanade."""
    rows, columns = np.gradient(seen)
    gradients = np.stack([columns.ravel(), rows.ravel()], axis=1)
    shift, *_ = np.linalg.lstsq(gradients, (predicted - seen).ravel(), rcond=None)
    return float(np.hypot(*shift))
