"""A simulated station that notes what its fingers did: how deep in an object they went, and whether they hold one."""

from __future__ import annotations

import numpy as np

from handsight.collection.sim.arm_model import GRIPPER_LINKS
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation
from handsight.datasets.records import SceneObjects

LIFTED_M = 0.02
"""An object is off the table when its lowest point is this far above it."""


class ContactStation(SimStation):
    """Does the same as any simulated station to the last bit, and looks at the contacts of every physics step."""

    def __init__(self, config: SimConfig) -> None:
        """Start a client."""
        self.deepest_m = 0.0
        """Largest overlap of a finger and an object in this attempt so far [m]."""
        super().__init__(config)

    def reset(self, rng: np.random.Generator) -> SceneObjects:
        """A new scene, in which no finger has been in anything yet."""
        self.deepest_m = 0.0
        scene = super().reset(rng)
        links = range(self._bullet.getNumJoints(self._arm.body))
        names = {self._bullet.getJointInfo(self._arm.body, link)[12].decode(): link for link in links}
        self._fingers = {names[name] for name in GRIPPER_LINKS if "finger" in name}
        return scene

    @property
    def holds(self) -> bool:
        """Whether an object is off the table with a finger pressing on it: what a look at the gripper would tell."""
        return any(
            self._bullet.getAABB(body)[0][2] > LIFTED_M and any(force_n > 0 for _, force_n in self._touches(body))
            for body in self._scene.bodies
        )

    def _step(self) -> None:
        super()._step()
        overlaps_m = [overlap_m for body in self._scene.bodies for overlap_m, _ in self._touches(body)]
        self.deepest_m = max([self.deepest_m, *overlaps_m])

    def _touches(self, body: int) -> list[tuple[float, float]]:
        """Overlap [m] and normal force [N] of every contact between a finger and an object."""
        contacts = self._bullet.getContactPoints(bodyA=self._arm.body, bodyB=body)
        return [(-contact[8], contact[9]) for contact in contacts if contact[3] in self._fingers]
