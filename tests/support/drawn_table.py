"""A drawn table with one bright disc: a world without physics for the servo loop."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from tests.support.scorers import FunctionScorer
from torch import Tensor

from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.homography import InputGrid
from handsight.servoing.planar import PlanarPose
from handsight.servoing.view import View

CAMERA = HandCamera(
    intrinsics=Intrinsics(width=160, height=120, fx=150.0, fy=150.0, cx=79.5, cy=59.5),
    x_tool_camera_m=0.0,
    y_tool_camera_m=-0.03,
    z_tool_camera_m=-0.1,
)
GRID = InputGrid(crop_px=96, size_px=32)
DISTANCE_M = 0.5
DISC_XY_M = (0.60, 0.02)


@dataclass
class DrawnTable:
    """A world without physics: draws the disc as the camera would see it and remembers where the gripper went."""

    pose: PlanarPose
    reachable_m: float = 10.0
    visited: list[PlanarPose] = field(default_factory=list)

    def look(self) -> tuple[View, PlanarPose]:
        k = CAMERA.intrinsics
        columns, rows = np.meshgrid(np.arange(k.width), np.arange(k.height))
        x_m = (columns - k.cx) * DISTANCE_M / k.fx + CAMERA.x_tool_camera_m
        y_m = (rows - k.cy) * DISTANCE_M / k.fy + CAMERA.y_tool_camera_m
        disc = self.pose.step_to(PlanarPose(x_m=DISC_XY_M[0], y_m=DISC_XY_M[1], angle_rad=0.0))
        glow = np.exp(-((x_m - disc.dx_m) ** 2 + (y_m - disc.dy_m) ** 2) / (2 * 0.05**2))
        rgb = np.repeat((255 * glow).astype(np.uint8)[:, :, None], 3, axis=2)
        depth_m = np.full((k.height, k.width), DISTANCE_M, np.float32)
        return View(rgb=rgb, depth_m=depth_m, camera=CAMERA), self.pose

    def move(self, pose: PlanarPose) -> bool:
        if abs(pose.x_m - DISC_XY_M[0]) > self.reachable_m:
            return False
        self.pose = pose
        self.visited.append(pose)
        return True


def brightness_in_the_middle(inputs: Tensor) -> Tensor:
    return inputs[:, 0, 15:17, 15:17].mean((1, 2))


BRIGHTNESS = FunctionScorer(brightness_in_the_middle, GRID)


START = PlanarPose(x_m=0.53, y_m=0.06, angle_rad=0.4)
