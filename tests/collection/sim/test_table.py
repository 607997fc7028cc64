"""The table's closed-form picture against the rasterised one."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from handsight.collection.sim.bullet import connect
from handsight.collection.sim.bullet import pybullet as pb
from handsight.collection.sim.camera import render_objects
from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.collection.sim.table import TABLE_CENTRE_M, TABLE_HALF_SIZE_M, TableTop, plane_depth_m, wooden_table
from handsight.servoing.planar import PlanarPose

INTRINSICS = D435_ON_GRIPPER.intrinsics
POSE = PlanarPose(x_m=0.62, y_m=0.03, angle_rad=0.5)


def test_table_matches_the_rasterised_one(tmp_path: Path) -> None:
    """Same picture and same depth as PyBullet draws of a textured square, tilted camera included."""
    top = wooden_table(np.random.default_rng(0))
    tilted = POSE.pose_base_tool(0.45)
    tilted[:3, :3] = tilted[:3, :3] @ cv2.Rodrigues(np.array([0.05, -0.04, 0.0]))[0]
    pose_base_camera = D435_ON_GRIPPER.pose_base_camera(tilted)
    cv2.imwrite(str(tmp_path / "wood.png"), cv2.cvtColor(top.texture[::-1], cv2.COLOR_RGB2BGR))
    half = TABLE_HALF_SIZE_M
    lines = [f"v {x} {y} 0" for x, y in ((-half, -half), (half, -half), (half, half), (-half, half))]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "vn 0 0 1", "f 1/1/1 2/2/1 3/3/1", "f 1/1/1 3/3/1 4/4/1"]
    (tmp_path / "square.obj").write_text("\n".join(lines), encoding="utf-8")
    bullet = connect()
    try:
        mesh = bullet.createVisualShape(pb.GEOM_MESH, fileName=str(tmp_path / "square.obj"))
        body = bullet.createMultiBody(0, -1, mesh, (*TABLE_CENTRE_M, 0.0))
        bullet.changeVisualShape(body, -1, textureUniqueId=bullet.loadTexture(str(tmp_path / "wood.png")))
        raster_rgb, raster_depth_m = render_objects(bullet, INTRINSICS, pose_base_camera)
    finally:
        bullet.disconnect()
    drawn_rgb, drawn_depth_m = top.draw(INTRINSICS, pose_base_camera)
    assert np.abs(drawn_depth_m - raster_depth_m).max() < 5e-4
    # The renderer shades the table by one factor; texture coordinates have to agree, so compare the pattern.
    a, b = drawn_rgb.astype(float).mean(2), raster_rgb.astype(float).mean(2)
    assert np.corrcoef(a.ravel(), b.ravel())[0, 1] > 0.98


def test_plane_depth_of_a_level_camera_is_its_height() -> None:
    depth_m = plane_depth_m(INTRINSICS, D435_ON_GRIPPER.pose_base_camera(POSE.pose_base_tool(0.4)))
    np.testing.assert_allclose(depth_m, 0.5, atol=1e-12)


def test_too_much_light_stops_at_white() -> None:
    top = TableTop(np.full((8, 8, 3), 200, np.uint8), size_m=2 * TABLE_HALF_SIZE_M)
    rgb, _ = top.draw(INTRINSICS, D435_ON_GRIPPER.pose_base_camera(POSE.pose_base_tool(0.4)), brightness=1.5)
    assert np.unique(rgb).tolist() == [255]
