"""Grippers by name, and the model of the arm that follows from them."""

from __future__ import annotations

from typing import get_args

import pytest

from handsight.cli import options
from handsight.collection.errors import StationSettingsError
from handsight.collection.sim.arm_model import FINGER_JOINTS, GRIPPER_LINKS, temporary_arm_urdf
from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.grippers import DEFAULT_GRIPPER, GRIPPERS, gripper_named


def test_names_carry_the_stroke_in_millimetres() -> None:
    assert {name: gripper.stroke_m for name, gripper in GRIPPERS.items()} == {"2f-85": 0.085, "2f-140": 0.14}
    assert all(gripper_named(name).name == name for name in GRIPPERS)


def test_the_command_line_knows_the_same_grippers() -> None:
    assert options.DEFAULT_GRIPPER == DEFAULT_GRIPPER
    assert get_args(get_args(options.Gripper)[0]) == tuple(GRIPPERS)


def test_unknown_grippers_name_the_known_ones() -> None:
    with pytest.raises(StationSettingsError, match=r"gripper is 'claw', expected one of: 2f-85, 2f-140"):
        gripper_named("claw")


@pytest.mark.parametrize("name", sorted(GRIPPERS))
def test_the_arm_is_composed_with_the_grippers_sizes(bullet: BulletClient, name: str) -> None:
    gripper = gripper_named(name)
    folder, urdf = temporary_arm_urdf(gripper)
    with folder:
        body = bullet.loadURDF(str(urdf), useFixedBase=True)
    infos = [bullet.getJointInfo(body, joint) for joint in range(bullet.getNumJoints(body))]
    limits_m = {info[1].decode(): info[9] for info in infos}
    links = {info[12].decode(): info[0] for info in infos}
    assert [limits_m[joint] for joint in FINGER_JOINTS] == [gripper.stroke_m / 2] * 2
    sizes_m = [bullet.getCollisionShapeData(body, links[link])[0][3] for link in GRIPPER_LINKS]
    assert sizes_m[0] == pytest.approx(gripper.palm_m)
    assert sizes_m[1] == sizes_m[2] == pytest.approx(gripper.finger_m)
