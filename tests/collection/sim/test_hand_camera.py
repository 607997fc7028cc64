"""The picture: closed-form table against the rasterised one, objects in front of it, the arm nowhere."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from handsight.collection.errors import StationSettingsError
from handsight.collection.sim.arm import Arm
from handsight.collection.sim.arm_model import temporary_arm_urdf
from handsight.collection.sim.bullet import connect
from handsight.collection.sim.bullet import pybullet as pb
from handsight.collection.sim.camera import Light, render, render_objects
from handsight.collection.sim.config import D435_ON_GRIPPER, SimConfig
from handsight.collection.sim.table import (
    TABLE_CENTRE_M,
    TABLE_HALF_SIZE_M,
    TableTop,
    plane_depth_m,
    wooden_table,
)
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


def test_objects_hide_the_table_and_are_measured() -> None:
    bullet = connect()
    try:
        box = bullet.createVisualShape(pb.GEOM_BOX, halfExtents=(0.02, 0.02, 0.03), rgbaColor=(1, 0, 0, 1))
        bullet.createMultiBody(0, -1, box, (POSE.x_m, POSE.y_m, 0.03))
        rgb, depth = render(
            bullet,
            wooden_table(np.random.default_rng(0)),
            D435_ON_GRIPPER,
            POSE.pose_base_tool(0.4),
            depth_scale_m=0.001,
        )
    finally:
        bullet.disconnect()
    top = depth == 440  # camera at 0.5 m, box top at 0.06 m
    assert 1500 < top.sum() < 4000
    assert depth.max() == 500
    assert (rgb[top][:, 0] > 2 * rgb[top][:, 1].astype(int)).all()
    columns = np.nonzero(top)[1]
    assert columns.mean() == pytest.approx(INTRINSICS.cx, abs=1.0)


def _lit(light: Light) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The top of a grey box and the table beside it, in this light."""
    bullet = connect()
    try:
        box = bullet.createVisualShape(pb.GEOM_BOX, halfExtents=(0.02, 0.02, 0.03), rgbaColor=(0.5, 0.5, 0.5, 1))
        bullet.createMultiBody(0, -1, box, (POSE.x_m, POSE.y_m, 0.03))
        grey = TableTop(np.full((64, 64, 3), 128, np.uint8), size_m=2 * TABLE_HALF_SIZE_M)
        rgb, depth = render(bullet, grey, D435_ON_GRIPPER, POSE.pose_base_tool(0.4), depth_scale_m=0.001, light=light)
    finally:
        bullet.disconnect()
    return rgb[depth == 440], rgb[:60, :60]


def test_by_default_the_table_shows_its_texture_as_it_is() -> None:
    _, table = _lit(Light())
    assert np.unique(table).tolist() == [128]


@pytest.mark.parametrize(
    "light",
    [
        Light(direction=(0.0, 0.0, 1.0), ambient=0.2, diffuse=0.3),
        Light(direction=(-2.0, 0.5, 0.6), ambient=0.5, diffuse=0.4),
        Light(direction=(1.0, 0.0, -0.2), ambient=0.7, diffuse=0.2),
    ],
    ids=["above", "low", "below"],
)
def test_light_falls_on_table_and_objects_alike(light: Light) -> None:
    """Both are level and grey, so that light makes them darker by the same factor."""
    box, table = _lit(light)
    usual_box, usual_table = _lit(Light())
    expected = light.on_table / Light().on_table
    assert table.mean() / usual_table.mean() == pytest.approx(expected, abs=0.01)
    # The renderer adds a little gloss of its own.
    assert box.mean() / usual_box.mean() == pytest.approx(expected, abs=0.06)


def test_too_much_light_stops_at_white() -> None:
    top = TableTop(np.full((8, 8, 3), 200, np.uint8), size_m=2 * TABLE_HALF_SIZE_M)
    rgb, _ = top.draw(INTRINSICS, D435_ON_GRIPPER.pose_base_camera(POSE.pose_base_tool(0.4)), brightness=1.5)
    assert np.unique(rgb).tolist() == [255]


def test_light_that_is_none_is_refused() -> None:
    with pytest.raises(StationSettingsError, match=r"direction is \(0, 0, 0\).*ambient is -0.1.*diffuse is 2"):
        Light(direction=(0, 0, 0), ambient=-0.1, diffuse=2)


@pytest.mark.parametrize("height_m", [0.5, 0.4, 0.2])
@pytest.mark.parametrize("width_m", [0.0, 0.085])
def test_the_arm_is_not_in_the_picture(height_m: float, width_m: float) -> None:
    """With all its meshes loaded the arm covers not one pixel, so leaving it undrawn changes nothing."""
    folder, urdf = temporary_arm_urdf(with_visuals=True)
    bullet = connect()
    try:
        arm = Arm(bullet, urdf, SimConfig(gripper_stroke_m=width_m or 0.005))
        arm.place(POSE.pose_base_tool(height_m))
        _, depth_m = render_objects(bullet, INTRINSICS, D435_ON_GRIPPER.pose_base_camera(arm.pose_base_tool))
    finally:
        bullet.disconnect()
        folder.cleanup()
    assert not np.isfinite(depth_m).any()
