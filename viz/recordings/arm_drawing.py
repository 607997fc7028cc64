"""The arm of a station, drawn: its shape once, then where its links stand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from handsight.viz.palette import STEEL

ROOT = "world/arm"


class DrawnLink(Protocol):
    """One rigid part of an arm, in its own frame."""

    @property
    def name(self) -> str:
        """Unique in the arm."""

    @property
    def vertices_m(self) -> NDArray[np.float32]:
        """Shape (V, 3)."""

    @property
    def normals(self) -> NDArray[np.float32]:
        """Shape (V, 3)."""

    @property
    def triangles(self) -> NDArray[np.uint32]:
        """Shape (T, 3)."""


class DrawnArm(Protocol):
    """An arm that can be drawn; who wires the station knows which."""

    @property
    def links(self) -> Sequence[DrawnLink]:
        """From the base to the flange."""

    def poses_base_link(self, pose_base_tool: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Where the links stand when the fingertips are at a pose; None where the arm cannot stand so. (L, 4, 4)."""


def log_arm_shape(stream: rr.RecordingStream, arm: DrawnArm) -> None:
    """Log the meshes, for all time."""
    for link in arm.links:
        stream.log(
            f"{ROOT}/{link.name}",
            rr.Mesh3D(
                vertex_positions=link.vertices_m,
                vertex_normals=link.normals,
                triangle_indices=link.triangles,
                albedo_factor=STEEL,
            ),
            static=True,
        )


def log_arm(stream: rr.RecordingStream, arm: DrawnArm, pose_base_tool: NDArray[np.float64]) -> None:
    """Log where the links stand when the fingertips are at a pose."""
    poses = arm.poses_base_link(pose_base_tool)
    if poses is None:
        return
    for link, pose in zip(arm.links, poses, strict=True):
        stream.log(f"{ROOT}/{link.name}", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
