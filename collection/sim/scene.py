"""Objects dropped onto the table and left to come to rest (paper, section V-B)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import PhaseAbortedError
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.engine import BulletClient, pybullet
from handsight.collection.sim.objects import ObjectModel

CLEARANCE_M = 0.06
"""Objects are dropped at least this far apart where there is room, else one above the other."""
PLACEMENT_TRIES = 20
STACK_STEP_M = 0.12
RESTING_SPEED_M_S = 0.01
RESTING_SPIN_RAD_S = 0.1
CHECK_EVERY_TICKS = 12


class Scene:
    """The objects of one attempt."""

    def __init__(self, engine: BulletClient, config: SimConfig) -> None:
        """An empty scene in ``engine``."""
        self._engine = engine
        self._config = config
        self.bodies: list[int] = []

    def drop(self, models: list[ObjectModel], rng: np.random.Generator) -> None:
        """Load ``models`` above the table, each in a random pose inside the workspace."""
        for model, position in zip(models, self._positions(len(models), rng), strict=True):
            body = self._engine.loadURDF(
                str(model.urdf), position.tolist(), _random_rotation(rng), globalScaling=model.scale
            )
            # Stock blocks roll for seconds: a little rolling friction and damping, as real things have, ends it.
            self._engine.changeDynamics(
                body, -1, linearDamping=0.1, angularDamping=0.3, rollingFriction=1e-3, spinningFriction=1e-3
            )
            self.bodies.append(body)

    def _positions(self, count: int, rng: np.random.Generator) -> list[NDArray[np.float64]]:
        placed: list[NDArray[np.float64]] = []
        for _ in range(count):
            level = 0
            for attempt in range(PLACEMENT_TRIES * count):
                level = attempt // PLACEMENT_TRIES
                x_m, y_m = self._config.workspace.sample(rng)
                position = np.array([x_m, y_m, self._config.drop_height_m + level * STACK_STEP_M])
                if all(np.linalg.norm(position - other) > 2 * CLEARANCE_M for other in placed):
                    break
            placed.append(position)
        return placed

    def settle(self) -> int:
        """Step until everything rests, then let it sleep; returns the number of ticks.

        Sleeping bodies cost no solver time until something touches them, which wakes them.

        Raises:
            PhaseAbortedError: something still moves at ``settle_limit_s``.
        """
        limit = round(self._config.settle_limit_s * self._config.physics_hz)
        for tick in range(1, limit + 1):
            self._engine.stepSimulation()
            if tick % CHECK_EVERY_TICKS == 0 and self._at_rest():
                break
        else:
            raise PhaseAbortedError("settle", f"objects still moved after {self._config.settle_limit_s:g} s")
        sleeping = pybullet.ACTIVATION_STATE_ENABLE_SLEEPING | pybullet.ACTIVATION_STATE_SLEEP
        for body in self.bodies:
            self._engine.changeDynamics(body, -1, activationState=sleeping)
        return tick

    def _at_rest(self) -> bool:
        for body in self.bodies:
            linear, angular = self._engine.getBaseVelocity(body)
            if math.hypot(*linear) > RESTING_SPEED_M_S or math.hypot(*angular) > RESTING_SPIN_RAD_S:
                return False
        return True

    def poses(self) -> NDArray[np.float64]:
        """Position and quaternion of every object, x y z qx qy qz qw. Shape (M, 7)."""
        states = [self._engine.getBasePositionAndOrientation(body) for body in self.bodies]
        return np.array([(*position, *orientation) for position, orientation in states])


def _random_rotation(rng: np.random.Generator) -> tuple[float, float, float, float]:
    """A uniformly distributed unit quaternion."""
    x, y, z, w = rng.normal(size=4)
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return x / norm, y / norm, z / norm, w / norm
