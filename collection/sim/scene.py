"""Objects dropped onto the table and left to come to rest (paper, section V-B)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import SceneUnsettledError
from handsight.collection.sim.bullet import BulletClient, pybullet
from handsight.collection.sim.config import DROP_SPACING_M, SimConfig
from handsight.collection.sim.objects.model import ObjectModel
from handsight.collection.sim.randomization import Randomization, Tint

PLACEMENT_TRIES = 20
"""Places tried in one layer before an object is dropped from the next layer above."""
RESTING_SPEED_M_S = 0.01
RESTING_SPIN_RAD_S = 0.1
CHECK_EVERY_TICKS = 12
SLIDE_SPEED_M_S = 0.1
"""Of an object that is pushed: what it meets is shoved aside, not struck."""


class Scene:
    """The objects of one attempt."""

    def __init__(self, bullet: BulletClient, config: SimConfig) -> None:
        """An empty scene in ``bullet``."""
        self._bullet = bullet
        self._config = config
        self.bodies: list[int] = []

    def drop(self, models: list[ObjectModel], rng: np.random.Generator, randomization: Randomization) -> None:
        """Load ``models`` above the table, each in a random pose inside the workspace."""
        for model, position in zip(models, self._positions(len(models), rng), strict=True):
            body = self._bullet.loadURDF(
                str(model.urdf), position.tolist(), random_rotation(rng), globalScaling=model.scale
            )
            # Stock blocks roll for seconds: a little rolling friction and damping, as real things have, ends it.
            self._bullet.changeDynamics(
                body, -1, linearDamping=0.1, angularDamping=0.3, rollingFriction=1e-3, spinningFriction=1e-3
            )
            if randomization.friction is not None:
                self._bullet.changeDynamics(body, -1, lateralFriction=randomization.friction.objects)
            self.bodies.append(body)
        for body, tint in zip(self.bodies, randomization.tints, strict=False):
            self._paint(body, tint)

    def _paint(self, body: int, tint: Tint) -> None:
        for shape in self._bullet.getVisualShapeData(body):
            link, (red, green, blue, alpha) = shape[1], shape[7]
            colour = (red * tint.red, green * tint.green, blue * tint.blue, alpha)
            self._bullet.changeVisualShape(body, link, rgbaColor=colour)

    def _positions(self, count: int, rng: np.random.Generator) -> list[NDArray[np.float64]]:
        placed: list[NDArray[np.float64]] = []
        for _ in range(count):
            for attempt in range(PLACEMENT_TRIES * count):
                layer = attempt // PLACEMENT_TRIES
                x_m, y_m = self._config.workspace.sample(rng)
                position = np.array([x_m, y_m, self._config.drop_height_m + layer * DROP_SPACING_M])
                if all(np.linalg.norm(position - other) > DROP_SPACING_M for other in placed):
                    break
            placed.append(position)
        return placed

    def settle(self) -> int:
        """Step until everything rests, then let it sleep; returns the number of ticks.

        Sleeping bodies cost no solver time until something touches them, which wakes them.

        Raises:
            SceneUnsettledError: Something still moves at ``settle_limit_s``.
        """
        limit = round(self._config.settle_limit_s * self._config.physics_hz)
        for tick in range(1, limit + 1):
            self._bullet.stepSimulation()
            if tick % CHECK_EVERY_TICKS == 0 and all(map(self.rests, self.bodies)):
                break
        else:
            raise SceneUnsettledError(f"objects still moved after {self._config.settle_limit_s:g} s")
        self.sleep()
        return tick

    def remove(self, body: int) -> None:
        """Take an object away; what it carried falls with the next steps."""
        self._bullet.removeBody(body)
        self.bodies.remove(body)

    def sleep(self) -> None:
        """Let every object that rests sleep until something touches it."""
        sleeping = pybullet.ACTIVATION_STATE_ENABLE_SLEEPING | pybullet.ACTIVATION_STATE_SLEEP
        for body in self.bodies:
            if self.rests(body):
                self._bullet.changeDynamics(body, -1, activationState=sleeping)

    def put(self, body: int, position_m: Sequence[float], orientation: Sequence[float]) -> None:
        """Put an object somewhere at once, at rest and awake; the orientation is a quaternion x y z w."""
        self._bullet.resetBasePositionAndOrientation(body, position_m, orientation)
        self._bullet.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0))
        self._bullet.changeDynamics(body, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP)

    def nearest(self, point_m: tuple[float, float]) -> int:
        """The body whose centre of mass is nearest to a point (x, y) of the table [m]."""
        distances_m = np.linalg.norm(self.poses()[:, :2] - point_m, axis=1)
        return self.bodies[int(distances_m.argmin())]

    def slide(self, body: int, by_m: tuple[float, float]) -> int:
        """Slide an object along the table without turning it, whatever is in its way; returns the number of ticks.

        It is led tick by tick, so that it arrives exactly where it is sent, while others obey the physics.

        Args:
            body: The object.
            by_m: How far, along x and y [m].
        """
        position, orientation = self._bullet.getBasePositionAndOrientation(body)
        start_m, by = np.array(position), np.array([*by_m, 0.0])
        ticks = max(1, math.ceil(math.hypot(*by_m) / SLIDE_SPEED_M_S * self._config.physics_hz))
        velocity = (by / ticks * self._config.physics_hz).tolist()
        self._bullet.changeDynamics(body, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP)
        for tick in range(ticks):
            self._bullet.resetBasePositionAndOrientation(body, (start_m + tick / ticks * by).tolist(), orientation)
            self._bullet.resetBaseVelocity(body, velocity, (0, 0, 0))
            self._bullet.stepSimulation()
        self._bullet.resetBasePositionAndOrientation(body, (start_m + by).tolist(), orientation)
        self._bullet.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0))
        return ticks

    def rests(self, body: int) -> bool:
        """Whether an object stands still, or nearly."""
        linear, angular = self._bullet.getBaseVelocity(body)
        return math.hypot(*linear) <= RESTING_SPEED_M_S and math.hypot(*angular) <= RESTING_SPIN_RAD_S

    def poses(self) -> NDArray[np.float64]:
        """Position and quaternion of every object, x y z qx qy qz qw. Shape (M, 7)."""
        states = [self._bullet.getBasePositionAndOrientation(body) for body in self.bodies]
        return np.array([(*position, *orientation) for position, orientation in states]).reshape(-1, 7)


def random_rotation(rng: np.random.Generator) -> tuple[float, float, float, float]:
    """A uniformly distributed unit quaternion."""
    x, y, z, w = rng.normal(size=4)
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return x / norm, y / norm, z / norm, w / norm
