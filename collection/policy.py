"""Where an attempt puts the gripper before it descends."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from handsight.collection.station import Station
from handsight.datasets.records import SceneObjects
from handsight.servoing.planar import PlanarPose


class PregraspPolicy(Protocol):
    """Chooses the pre-grasp pose of an attempt."""

    def choose(self, station: Station, scene: SceneObjects | None, rng: np.random.Generator) -> PlanarPose:
        """The pose to reach, in the base frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformPolicy:
    """The paper's random grasps: uniform around a random object and uniform in angle (section V-B).

    Where the objects' poses are unknown, as on a rig, the position is uniform over the workspace (section V-C).
    """

    half_range_m: float = 0.125

    def choose(self, station: Station, scene: SceneObjects | None, rng: np.random.Generator) -> PlanarPose:
        """Draw a pose."""
        if scene is None:
            x_m, y_m = station.workspace.sample(rng)
        else:
            centre = scene.pose_base_object[scene.target, :2]
            x_m, y_m = centre + rng.uniform(-self.half_range_m, self.half_range_m, size=2)
        # A jaw turned by half a turn is the same jaw, so half a turn covers every grasp.
        angle_rad = rng.uniform(-0.5 * math.pi, 0.5 * math.pi)
        return PlanarPose(x_m=float(x_m), y_m=float(y_m), angle_rad=float(angle_rad))
