"""Where an attempt puts the gripper before it descends."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Protocol

import numpy as np

from handsight.collection.station import Station
from handsight.datasets.records import SceneObjects
from handsight.servoing.planar import PlanarPose


@dataclass(frozen=True, slots=True, kw_only=True)
class Pregrasp:
    """Where an attempt grasps."""

    pose: PlanarPose
    """In the base frame."""
    predicted_success: float = math.nan
    """What the policy's network expects of it; NaN for a pose that no network chose."""


class PregraspPolicy(Protocol):
    """Chooses the pre-grasp pose of an attempt. Must survive pickling."""

    def choose(self, station: Station, scene: SceneObjects | None, rng: np.random.Generator) -> Pregrasp:
        """The pose to reach. The station may have been moved, but not below the pre-grasp height."""

    def settings(self) -> dict[str, object]:
        """What decides the choice beside the station and the random stream, as JSON values, ``name`` among them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformPolicy:
    """The paper's random grasps: uniform around a random object and uniform in angle (section V-B).

    Where the objects' poses are unknown, as on a rig, the position is uniform over the workspace (section V-C).
    """

    half_range_m: float = 0.125

    def settings(self) -> dict[str, object]:
        """The range."""
        return {"name": "uniform", **asdict(self)}

    def choose(self, station: Station, scene: SceneObjects | None, rng: np.random.Generator) -> Pregrasp:
        """Draw a pose."""
        if scene is None:
            x_m, y_m = station.workspace.sample(rng)
        else:
            centre = scene.pose_base_object[scene.target, :2]
            x_m, y_m = centre + rng.uniform(-self.half_range_m, self.half_range_m, size=2)
        # A jaw turned by half a turn is the same jaw, so half a turn covers every grasp.
        angle_rad = rng.uniform(-0.5 * math.pi, 0.5 * math.pi)
        return Pregrasp(pose=PlanarPose(x_m=float(x_m), y_m=float(y_m), angle_rad=float(angle_rad)))
