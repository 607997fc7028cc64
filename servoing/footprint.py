"""The part of the table that a picture shows, as steps of the gripper: where a search over all of it may go."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from handsight.servoing.camera import HandCamera


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprint:
    """The rectangle of the assumed plane under the centres of the outermost pixels, in the tool frame."""

    x_min_m: float
    x_max_m: float
    y_min_m: float
    y_max_m: float

    @classmethod
    def of(cls, camera: HandCamera, *, plane_m: float) -> Footprint:
        """What ``camera`` sees of a plane at a distance ``plane_m`` along its optical axis."""
        k = camera.intrinsics
        return cls(
            x_min_m=camera.x_tool_camera_m - k.cx * plane_m / k.fx,
            x_max_m=camera.x_tool_camera_m + (k.width - 1 - k.cx) * plane_m / k.fx,
            y_min_m=camera.y_tool_camera_m - k.cy * plane_m / k.fy,
            y_max_m=camera.y_tool_camera_m + (k.height - 1 - k.cy) * plane_m / k.fy,
        )

    def uniform_steps(self, count: int, rng: np.random.Generator) -> Tensor:
        """Steps to anywhere in it, turned by up to a quarter turn either way: all that two equal jaws can tell apart.

        Returns:
            (dx [m], dy [m], dangle [rad]), float32. Shape (count, 3).
        """
        lower = [self.x_min_m, self.y_min_m, -0.5 * math.pi]
        upper = [self.x_max_m, self.y_max_m, 0.5 * math.pi]
        return torch.from_numpy(rng.uniform(lower, upper, (count, 3)).astype(np.float32))

    def clamped(self, steps: Tensor) -> Tensor:
        """The steps, those that lead out of it moved to its edge. (..., 3) -> (..., 3)."""
        lower = steps.new_tensor([self.x_min_m, self.y_min_m, -math.inf])
        upper = steps.new_tensor([self.x_max_m, self.y_max_m, math.inf])
        return steps.clamp(lower, upper)

    def contains(self, steps: Tensor) -> Tensor:
        """Which steps lead to a place in it. (..., 3) -> (...), bool."""
        x_m, y_m = steps[..., 0], steps[..., 1]
        return (self.x_min_m <= x_m) & (x_m <= self.x_max_m) & (self.y_min_m <= y_m) & (y_m <= self.y_max_m)
