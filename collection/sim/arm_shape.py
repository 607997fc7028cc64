"""The UR10's shape and how its links stand at a pose, for whoever draws it: meshes once, one pose for each link.

The meshes are those that the arm's package ships for collisions: its real shape in a few thousand triangles, where the
visual ones have hundreds of thousands.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import cached_property
from importlib import metadata
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handsight.collection.errors import UnreachableError
from handsight.collection.sim.arm_model import ARM_JOINTS
from handsight.collection.sim.kinematics import REFERENCE_RAD, joints_for

FACET_RAD = 0.5
"""Edges sharper than this are drawn as edges."""
_FIRST_LINK = "base_link"
_HALF_A_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
"""From the controller's base frame to ``base_link``, which is turned by half a turn about z."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkShape:
    """One rigid part, in its own frame."""

    name: str
    vertices_m: NDArray[np.float32]
    """Shape (V, 3)."""
    normals: NDArray[np.float32]
    """Shape (V, 3)."""
    triangles: NDArray[np.uint32]
    """Shape (T, 3)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Joint:
    link: str
    """The link that it moves."""
    pose_parent_joint: NDArray[np.float64]
    """Where it is on the link before it, at 0. Shape (4, 4)."""
    axis: NDArray[np.float64]
    """In its own frame. Shape (3,)."""


class Ur10Shape:
    """The arm of the stations, read from the package that ships its model."""

    @cached_property
    def links(self) -> tuple[LinkShape, ...]:
        """All links that have a mesh, from the base to the flange."""
        return tuple(_shape(self._robot, link) for link in self._names)

    def poses_base_link(self, pose_base_tool: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Where the links stand when the fingertips are at a pose; None where the arm cannot stand so. (L, 4, 4)."""
        try:
            joints_rad = joints_for(pose_base_tool, REFERENCE_RAD, phase="picture")
        except UnreachableError:
            return None
        poses = [_HALF_A_TURN]
        for joint, angle_rad in zip(self._joints, joints_rad.tolist(), strict=True):
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(angle_rad * joint.axis).as_matrix()
            poses.append(poses[-1] @ joint.pose_parent_joint @ turn)
        return np.stack(poses)

    @property
    def _names(self) -> tuple[str, ...]:
        return _FIRST_LINK, *(joint.link for joint in self._joints)

    @cached_property
    def _robot(self) -> ElementTree.Element:
        return ElementTree.parse(_share() / "example-robot-data/robots/ur_description/urdf/ur10_robot.urdf").getroot()

    @cached_property
    def _joints(self) -> tuple[_Joint, ...]:
        return tuple(_joint(self._robot, name) for name in ARM_JOINTS)


def _share() -> Path:
    return Path(str(metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))


def _joint(robot: ElementTree.Element, name: str) -> _Joint:
    (element,) = robot.findall(f"joint[@name='{name}']")
    origin, axis, child = (element.find(tag) for tag in ("origin", "axis", "child"))
    if origin is None or axis is None or child is None:
        raise ValueError(f"joint {name!r} of the UR10's model lacks its origin, axis or child, expected all of them")
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", _numbers(origin.get("rpy", "0 0 0"))).as_matrix()
    pose[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
    return _Joint(link=str(child.get("link")), pose_parent_joint=pose, axis=_numbers(str(axis.get("xyz"))))


def _shape(robot: ElementTree.Element, link: str) -> LinkShape:
    (element,) = robot.findall(f"link[@name='{link}']/collision/geometry/mesh")
    path = element.attrib["filename"].replace("package:/", str(_share()), 1)
    mesh = trimesh.load_mesh(path, file_type="stl")
    shaded = trimesh.graph.smooth_shade(mesh, angle=FACET_RAD)
    return LinkShape(
        name=link,
        vertices_m=np.asarray(shaded.vertices, dtype=np.float32),
        normals=np.asarray(shaded.vertex_normals, dtype=np.float32),
        triangles=np.asarray(shaded.faces, dtype=np.uint32),
    )


def _numbers(text: str) -> NDArray[np.float64]:
    return np.array([float(word) for word in text.split()])
