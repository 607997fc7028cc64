"""The picture: objects in front of the table, light on both, the arm nowhere."""

from __future__ import annotations

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
from handsight.collection.sim.grippers import gripper_named
from handsight.collection.sim.table import TABLE_HALF_SIZE_M, TableTop, wooden_table
from handsight.servoing.planar import PlanarPose

INTRINSICS = D435_ON_GRIPPER.intrinsics
POSE = PlanarPose(x_m=0.62, y_m=0.03, angle_rad=0.5)


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


def test_light_that_is_none_is_refused() -> None:
    with pytest.raises(StationSettingsError, match=r"direction is \(0, 0, 0\).*ambient is -0.1.*diffuse is 2"):
        Light(direction=(0, 0, 0), ambient=-0.1, diffuse=2)


@pytest.mark.parametrize("height_m", [0.5, 0.4, 0.2])
@pytest.mark.parametrize("width_m", [0.0, 0.085, 0.14])
def test_the_arm_is_not_in_the_picture(height_m: float, width_m: float) -> None:
    """With all its meshes loaded the arm covers not one pixel, so leaving it undrawn changes nothing."""
    gripper = gripper_named("2f-140" if width_m > 0.085 else "2f-85")
    folder, urdf = temporary_arm_urdf(gripper, with_visuals=True)
    bullet = connect()
    try:
        arm = Arm(bullet, urdf, SimConfig(gripper=gripper.name))
        arm.hand.place_fingers(width_m)
        arm.place(POSE.pose_base_tool(height_m))
        _, depth_m = render_objects(bullet, INTRINSICS, D435_ON_GRIPPER.pose_base_camera(arm.hand.pose_base_tool))
    finally:
        bullet.disconnect()
        folder.cleanup()
    assert not np.isfinite(depth_m).any()
