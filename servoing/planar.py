"""Planar poses p = (x, y, theta) of a top-down gripper, and the steps between them (paper, section III-A).

The tool frame T points down: its z axis is the approach direction, so seen from above a positive step angle turns
clockwise. A pose angle is measured about the *upward* z axis of the base, as the robot's controller does, hence the
sign flip in :meth:`PlanarPose.after`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarStep:
    """A delta pose in the current tool frame: translate by (dx, dy), then turn about the approach axis."""

    dx_m: float
    dy_m: float
    dangle_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarPose:
    """Where a top-down gripper stands over the table, in the base frame."""

    x_m: float
    y_m: float
    angle_rad: float
    """Direction of the tool's x axis (in which the jaws close) about the base's upward z axis."""

    def after(self, step: PlanarStep) -> PlanarPose:
        """The pose reached from this one by ``step``; pose_base_tool · pose_tool_tool' on SE(3)."""
        cos, sin = math.cos(self.angle_rad), math.sin(self.angle_rad)
        # R_base_tool = Rz(angle) Rx(pi): the tool's y axis is (sin, -cos) in the base.
        return PlanarPose(
            x_m=self.x_m + cos * step.dx_m + sin * step.dy_m,
            y_m=self.y_m + sin * step.dx_m - cos * step.dy_m,
            angle_rad=self.angle_rad - step.dangle_rad,
        )

    def step_to(self, other: PlanarPose) -> PlanarStep:
        """The step that leads from this pose to ``other``; the inverse of :meth:`after`."""
        cos, sin = math.cos(self.angle_rad), math.sin(self.angle_rad)
        dx, dy = other.x_m - self.x_m, other.y_m - self.y_m
        turn = math.remainder(self.angle_rad - other.angle_rad, 2 * math.pi)
        return PlanarStep(dx_m=cos * dx + sin * dy, dy_m=sin * dx - cos * dy, dangle_rad=turn)

    def pose_base_tool(self, height_m: float) -> NDArray[np.float64]:
        """Tool frame in the base frame at ``height_m`` above the table. Shape (4, 4)."""
        cos, sin = math.cos(self.angle_rad), math.sin(self.angle_rad)
        return np.array(
            [
                [cos, sin, 0.0, self.x_m],
                [sin, -cos, 0.0, self.y_m],
                [0.0, 0.0, -1.0, height_m],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )

    @classmethod
    def from_pose_base_tool(cls, pose_base_tool: NDArray[np.float64]) -> PlanarPose:
        """Read the planar part of a top-down tool pose, shape (4, 4)."""
        angle_rad = math.atan2(pose_base_tool[1, 0], pose_base_tool[0, 0])
        return cls(x_m=float(pose_base_tool[0, 3]), y_m=float(pose_base_tool[1, 3]), angle_rad=angle_rad)
