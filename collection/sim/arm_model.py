"""The UR10 with the parallel gripper as one URDF, composed at run time from the package that ships the arm.

One articulated body for arm and gripper is stiffer and faster than two bodies joined by a constraint. Visual meshes
are left out unless asked for: the hand camera cannot see the arm (a test shows it), and loading them takes a hundred
times longer than the rest.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from importlib import metadata, resources
from pathlib import Path

from handsight.collection.sim.grippers import FLANGE_TO_TIP_M, Gripper
from handsight.datasets.held import HeldFolder

ARM_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
FINGER_JOINTS = ("gripper_left_joint", "gripper_right_joint")
HAND_JOINT = "gripper_mount"
"""The slide by which the hand hangs on the flange; see ``hand.py``."""
HAND_TRAVEL_M = 0.04
GRIPPER_LINKS = ("gripper_palm", "gripper_left_finger", "gripper_right_finger")

# ee_link holds a stray 1 cm collision box at the flange that would touch the gripper; world only pins the base.
_DROPPED_LINKS = ("world", "ee_link")


def compose_arm_urdf(folder: Path, gripper: Gripper, *, with_visuals: bool = False) -> Path:
    """Write the URDF of arm and gripper into ``folder`` and return its path."""
    share = Path(str(metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    tree = ElementTree.parse(share / "example-robot-data/robots/ur_description/urdf/ur10_robot.urdf")
    robot = tree.getroot()
    _attach_gripper(robot, gripper)
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


def _attach_gripper(robot: ElementTree.Element, gripper: Gripper) -> None:
    asset = resources.files("handsight.collection.sim") / "assets" / "parallel_gripper.urdf"
    parts = ElementTree.fromstring(asset.read_text(encoding="utf-8"))
    for name in FINGER_JOINTS:
        _find(parts, "joint", name, "origin").set("xyz", f"0 0 {FLANGE_TO_TIP_M}")
        _find(parts, "joint", name, "limit").set("upper", f"{0.5 * gripper.stroke_m}")
    for name, side in zip(GRIPPER_LINKS, (0, -1, 1), strict=True):
        size_m = gripper.finger_m if side else gripper.palm_m
        # A finger's frame is the inner edge of its tip; the palm ends where the fingers begin.
        centre_m = (
            (0.5 * side * size_m[0], 0.0, -0.5 * size_m[2])
            if side
            else (0.0, 0.0, FLANGE_TO_TIP_M - gripper.finger_m[2] - 0.5 * size_m[2])
        )
        for kind in ("visual", "collision"):
            _find(parts, "link", name, f"{kind}/origin").set("xyz", _numbers(centre_m))
            _find(parts, "link", name, f"{kind}/geometry/box").set("size", _numbers(size_m))
    robot.extend(parts)
    mount = ElementTree.SubElement(robot, "joint", name=HAND_JOINT, type="prismatic")
    ElementTree.SubElement(mount, "parent", link="tool0")
    ElementTree.SubElement(mount, "child", link="gripper_palm")
    ElementTree.SubElement(mount, "axis", xyz="0 0 1")
    ElementTree.SubElement(mount, "limit", lower=f"{-HAND_TRAVEL_M}", upper="0", effort="1000", velocity="2")


def _find(robot: ElementTree.Element, tag: str, name: str, path: str) -> ElementTree.Element:
    """The element at a path below the link or joint of that name, which the asset has."""
    (found,) = robot.findall(f"{tag}[@name='{name}']/{path}")
    return found


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def temporary_arm_urdf(gripper: Gripper, *, with_visuals: bool = False) -> tuple[HeldFolder, Path]:
    """The URDF in a folder that is deleted with the returned handle; that of a killed process is by the next one."""
    folder = HeldFolder("handsight-arm-")
    return folder, compose_arm_urdf(folder.path, gripper, with_visuals=with_visuals)
