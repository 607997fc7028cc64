"""A station without physics whose phases do what a test says, and which remembers how it was used."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from tests.support.small_station import small_header

from handsight.collection.errors import PhaseAbortedError, UnreachableError
from handsight.collection.station import Descent, Workspace
from handsight.datasets import RgbdFrame, SceneObjects, StationSpec
from handsight.servoing.planar import PlanarPose

HEIGHT_M = 0.4
AREA = Workspace(x_min_m=0.5, x_max_m=0.7, y_min_m=-0.1, y_max_m=0.1)


@dataclass
class ScriptedStation:
    """Everything goes well, and an object is held, unless a phase is named in ``faults``."""

    faults: dict[str, int] = field(default_factory=dict)
    """Phases that fail, each from which of its calls in a scene on, counted from 0."""
    depth_m: float = 0.4
    """Of every pixel."""
    contact_force_n: float = 0.0
    contact_height_m: float = 0.005
    widths_m: tuple[float, float, float] = (0.03, 0.03, 0.03)
    """Closed, lifted, shaken."""
    truth_held: bool | None = True
    touched_by: str = ""
    calls: list[str] = field(default_factory=list)
    spec: StationSpec = field(default_factory=lambda: small_header(source="ur10", seed=None).station)
    workspace: Workspace = AREA
    clock_s: float = 0.0
    width_m: float = 0.085
    pose: PlanarPose = field(default_factory=lambda: PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.0))

    def _phase(self, name: str) -> None:
        count = self.calls.count(name)
        self.calls.append(name)
        if name in self.faults and count >= self.faults[name]:
            kind = UnreachableError if name == "reach" else PhaseAbortedError
            raise kind(name, "scripted")

    def reset(self, rng: np.random.Generator) -> SceneObjects | None:
        self.calls.clear()
        self._phase("settle")
        return None

    def look(self) -> RgbdFrame:
        self._phase("look")
        k = self.spec.camera.intrinsics
        depth = np.full((k.height, k.width), round(self.depth_m / self.spec.depth_scale_m), np.uint16)
        rgb = np.full((k.height, k.width, 3), 128, np.uint8)
        return RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=self.pose.pose_base_tool(HEIGHT_M))

    def reach(self, pose: PlanarPose) -> None:
        self._phase("reach")
        self.pose = pose

    def descend(self) -> Descent:
        self._phase("descend")
        return Descent(
            contact_force_n=self.contact_force_n,
            pose_base_tool=self.pose.pose_base_tool(self.contact_height_m),
            touched_by=self.touched_by,
        )

    def close_gripper(self) -> float:
        self._phase("close")
        return self.widths_m[0]

    def lift(self) -> float:
        self._phase("lift")
        return self.widths_m[1]

    def shake(self) -> float:
        self._phase("shake")
        return self.widths_m[2]

    def held_in_truth(self) -> bool | None:
        return self.truth_held

    def close(self) -> None:
        self.calls.append("closed")
