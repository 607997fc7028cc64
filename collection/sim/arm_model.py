"""The UR10 with the parallel gripper as one URDF, composed at run time from the package that ships the arm.

One articulated body for arm and gripper is stiffer and faster than two bodies joined by a constraint. Visual meshes
are left out unless asked for: the hand camera cannot see the arm (a test shows it), and loading them takes a hundred
times longer than the rest.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from importlib import metadata, resources
from pathlib import Path

from handsight.datasets.held import HeldFolder

FLANGE_TO_TIP_M = 0.16
"""Distance from the UR10's flange to the fingertips, as in ``assets/parallel_gripper.urdf``."""

ARM_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
FINGER_JOINTS = ("gripper_left_joint", "gripper_right_joint")
GRIPPER_LINKS = ("gripper_palm", "gripper_left_finger", "gripper_right_finger")

# ee_link holds a stray 1 cm collision box at the flange that would touch the gripper; world only pins the base.
_DROPPED_LINKS = ("world", "ee_link")


def compose_arm_urdf(folder: Path, *, with_visuals: bool = False) -> Path:
    """Write the URDF of arm and gripper into ``folder`` and return its path."""
    share = Path(str(metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    tree = ElementTree.parse(share / "example-robot-data/robots/ur_description/urdf/ur10_robot.urdf")
    robot = tree.getroot()
    _attach_gripper(robot)
    _drop(robot, with_visuals=with_visuals)
    for mesh in robot.iter("mesh"):
        mesh.set("filename", mesh.attrib["filename"].replace("package:/", str(share), 1))
    path = folder / "ur10_with_gripper.urdf"
    tree.write(path)
    return path


def _drop(robot: ElementTree.Element, *, with_visuals: bool) -> None:
    for element in list(robot):
        links = {child.get("link") for child in element if child.tag in ("parent", "child")}
        if (
            element.tag in ("gazebo", "transmission")
            or links & set(_DROPPED_LINKS)
            or (element.tag == "link" and element.get("name") in _DROPPED_LINKS)
        ):
            robot.remove(element)
        elif element.tag == "link" and not with_visuals:
            for visual in element.findall("visual"):
                element.remove(visual)


def _attach_gripper(robot: ElementTree.Element) -> None:
    asset = resources.files("handsight.collection.sim") / "assets" / "parallel_gripper.urdf"
    robot.extend(ElementTree.fromstring(asset.read_text(encoding="utf-8")))
    mount = ElementTree.SubElement(robot, "joint", name="gripper_mount", type="fixed")
    ElementTree.SubElement(mount, "parent", link="tool0")
    ElementTree.SubElement(mount, "child", link="gripper_palm")


def temporary_arm_urdf(*, with_visuals: bool = False) -> tuple[HeldFolder, Path]:
    """The URDF in a folder that is deleted with the returned handle; that of a killed process is by the next one."""
    folder = HeldFolder("handsight-arm-")
    return folder, compose_arm_urdf(folder.path, with_visuals=with_visuals)
