"""Arm, jaws, objects and table in PyBullet, moved in step with the emulated controller.

Everything is of the simulated station: objects, gripper, contact, pictures. What differs is who moves the arm, and that
scenes go on: what is dropped lies where it fell, and only somebody who is asked puts back what left the table.

The hand hangs on a slide that gives way (``sim/hand.py``). Here it holds 45 N beside its weight while the arm moves, so
that a descent meets more than the 40 N at which a rig stops, yet yields before the arm's motors press with hundreds;
while the jaws close it holds the simulator's 15 N, so that grasps fare as they do there.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import SceneUnsettledError
from handsight.collection.sim.arm import Arm
from handsight.collection.sim.arm_model import temporary_arm_urdf
from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.config import DROP_SPACING_M, MOST_REDRAWS, SimConfig
from handsight.collection.sim.grippers import gripper_named
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.randomization import Randomization
from handsight.collection.sim.renderer import EmptyClients, renderer_named
from handsight.collection.sim.scene import Scene, random_rotation
from handsight.collection.sim.station import LIFTED_M, TABLE_SEED, check_object_count
from handsight.collection.sim.table import TABLE_FRICTION, TableTop, add_table, wooden_table
from handsight.servoing.planar import PlanarPose

ARM_YIELD_N = 45.0
QUIET_AFTER_S = 0.5
"""With arm and jaws at rest for so long, and every object too, physics is left out until something is moved."""
JAWS_REST_M_S = 0.002
JAWS_WATCHED_S = 0.05
"""The speed of the jaws is that from one mean position to the next, each over so long: pressed onto something they
tremble by half a millimetre, at speeds that would pass for motion."""
SLEEP_EVERY_S = 0.25
SLIP_S = 0.25
SLIP_SPEED_M_S = 0.1
"""What slips is let go for so long, by jaws that run apart at so much each."""
HAND_CLEARANCE_M = 0.17
"""Objects are put so far beside the hand."""
PLACES = 200
"""Places that are tried for an object that is put back."""


class PhysicalWorld:
    """A :class:`~handsight.collection.ur10.emulator.world.World` with objects."""

    def __init__(self, config: SimConfig, seed: int) -> None:
        """Drop a scene and let it come to rest; the arm stands above it.

        Raises:
            ObjectSetError: Unknown object set, or too few objects in it.
            SceneUnsettledError: No scene came to rest.
        """
        self.config = config
        self._rng = np.random.default_rng([seed, 63352])
        self.renderer = renderer_named(config.renderer)
        self._clients = EmptyClients(self.renderer)
        self._folder, self._urdf = temporary_arm_urdf(gripper_named(config.gripper))
        self.table: TableTop = wooden_table(np.random.default_rng(TABLE_SEED))
        self._models = load_object_set(config.objects)
        check_object_count(self._models, config)
        self._make_scene()
        self.stroke_m = config.gripper_stroke_m
        self.steps = 0
        """Steps of the physics so far; a picture of the same step is the same."""
        self._owed_s = self._still_s = self._since_sleep_s = 0.0
        self._slip_left_s = 0.0
        self._measured_rad: NDArray[np.float64] = self.arm.joints_rad
        self._measured_rad_s = np.zeros(6)
        count = 2 * round(JAWS_WATCHED_S * config.physics_hz)
        self._widths_m = deque([self.arm.hand.width_m] * count, maxlen=count)
        self._jaw_speed_m_s = 0.0
        self._read()

    def _make_scene(self) -> None:
        for tries in range(MOST_REDRAWS + 1):
            self._empty()
            chosen = self._rng.choice(len(self._models), size=self.config.objects_per_scene, replace=False)
            self.object_ids = [self._models[index].object_id for index in chosen]
            self.scene.drop([self._models[index] for index in chosen], self._rng, Randomization())
            try:
                self.scene.settle()
                break
            except SceneUnsettledError:
                if tries == MOST_REDRAWS:
                    raise
        self.arm = Arm(self.bullet, self._urdf, self.config)
        area = self.config.workspace
        middle = PlanarPose(
            x_m=0.5 * (area.x_min_m + area.x_max_m), y_m=0.5 * (area.y_min_m + area.y_max_m), angle_rad=0.0
        )
        self.arm.place(middle.pose_base_tool(self.config.overhead_height_m))
        self.arm.hand.resist(ARM_YIELD_N)
        self._target_rad = self.arm.joints_rad

    def _empty(self) -> None:
        bullet: BulletClient = self._clients.empty()
        self.bullet = bullet
        bullet.setGravity(0, 0, -9.81)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / self.config.physics_hz,
            numSolverIterations=self.config.solver_iterations,
            solverResidualThreshold=self.config.solver_residual,
            deterministicOverlappingPairs=1,
        )
        add_table(bullet, friction=TABLE_FRICTION)
        self.scene = Scene(bullet, self.config)

    # The world that devices act on.

    @property
    def joints_rad(self) -> NDArray[np.float64]:
        """Measured joint angles [rad]. Shape (6,)."""
        return self._joints_rad

    @property
    def contact_n(self) -> NDArray[np.float64]:
        """What presses on arm and hand, in base axes [N]. Shape (3,)."""
        return self._contact_n

    @property
    def width_m(self) -> float:
        """Opening between the jaws [m]."""
        return self._width_m

    @property
    def jaw_speed_m_s(self) -> float:
        """How far the jaws have moved against each other of late, by how long that took [m/s]."""
        return self._jaw_speed_m_s

    @property
    def holds(self) -> bool:
        """Whether the jaws hold something off the table."""
        return bool(self.held())

    @property
    def quiet(self) -> bool:
        """Whether nothing moves, and physics is left out."""
        return self._still_s > QUIET_AFTER_S

    def advance(self, seconds: float, joints_rad: NDArray[np.float64]) -> None:
        """Let time pass, at the end of which the joints are sent to these angles."""
        start_rad, moves = self._target_rad, joints_rad is not self._target_rad
        self._target_rad = joints_rad
        moves = moves and bool((joints_rad != start_rad).any())
        self._still_s = 0.0 if moves or self._jaw_speed_m_s > JAWS_REST_M_S else self._still_s + seconds
        if self.quiet:
            if self._all_rest():
                return
            self._still_s = 0.0
        speed_rad_s = (joints_rad - start_rad) / seconds
        step_s = 1 / self.config.physics_hz
        self._owed_s += seconds
        while self._owed_s >= step_s:
            self._owed_s -= step_s
            # Where the joints are to be when this step is over.
            share = min(max(1.0 - self._owed_s / seconds, 0.0), 1.0)
            self.arm.follow(start_rad + share * (joints_rad - start_rad), speed_rad_s)
            self.step()
        self._joints_rad = self._measured_rad + self._owed_s * self._measured_rad_s

    def step(self) -> None:
        """One step of the physics."""
        before_rad = self._measured_rad
        self.bullet.stepSimulation()
        self.steps += 1
        self._read()
        self._measured_rad_s = (self._measured_rad - before_rad) * self.config.physics_hz
        self._end_slip(1 / self.config.physics_hz)
        self._since_sleep_s += 1 / self.config.physics_hz
        if self._since_sleep_s >= SLEEP_EVERY_S:
            self._since_sleep_s = 0.0
            self.scene.sleep()

    def _read(self) -> None:
        hand = self.arm.hand
        self._measured_rad = self._joints_rad = self.arm.joints_rad
        self._contact_n = hand.contact_n
        self._width_m = hand.width_m
        self._widths_m.append(self._width_m)
        half = len(self._widths_m) // 2
        moved_m = sum(islice(self._widths_m, half, None)) - sum(islice(self._widths_m, half))
        self._jaw_speed_m_s = abs(moved_m) / half / JAWS_WATCHED_S

    def _all_rest(self) -> bool:
        return all(map(self.scene.rests, self.scene.bodies))

    def drive_jaws(self, speed_m_s: float) -> None:
        """Run the jaws against each other at this speed [m/s] until they meet something; negative closes, 0 holds."""
        self._still_s = 0.0
        closing = speed_m_s < 0
        iterations = self.config.grip_iterations if closing else self.config.solver_iterations
        if closing or speed_m_s > 0:
            self.bullet.setPhysicsEngineParameter(numSolverIterations=iterations)
            self.arm.hand.resist(self.config.yield_force_n if closing else ARM_YIELD_N)
        self.arm.hand.drive_fingers(opening_m_s=0.5 * speed_m_s)

    def slip(self) -> bool:
        """Let what the jaws hold out of their grip, which then closes on nothing; whether they hold anything.

        Taking the friction away is not enough: many an object is held by its form.
        """
        held = bool(self.held())
        if held:
            self._slip_left_s = SLIP_S
            self._still_s = 0.0
            self.arm.hand.drive_fingers(opening_m_s=SLIP_SPEED_M_S)
        return held

    def _end_slip(self, seconds: float) -> None:
        if self._slip_left_s > 0:
            self._slip_left_s -= seconds
            if self._slip_left_s <= 0:
                self.arm.hand.drive_fingers(opening_m_s=-SLIP_SPEED_M_S)

    # What an onlooker sees and does.

    def held(self) -> list[int]:
        """Objects off the table that a finger presses on."""
        lifted = [body for body in self.scene.bodies if self.bullet.getAABB(body)[0][2] > LIFTED_M]
        return [body for body in lifted if self.arm.hand.touches(body)]

    def lost(self) -> list[int]:
        """Objects that nobody can grasp: beside the workspace, or fallen off the table."""
        area = self.config.workspace
        return [
            body
            for body, (x_m, y_m, z_m) in zip(self.scene.bodies, self.scene.poses()[:, :3], strict=True)
            if not (area.x_min_m <= x_m <= area.x_max_m and area.y_min_m <= y_m <= area.y_max_m and z_m > -0.01)
        ]

    def refill(self, *, everything: bool = False) -> int:
        """Put lost objects back, or drop all that are not held anew; returns how many. They fall as time passes."""
        held = set(self.held())
        bodies = [body for body in (self.scene.bodies if everything else self.lost()) if body not in held]
        for body in bodies:
            self.scene.put(body, self._free_place(body), random_rotation(self._rng))
        self._still_s = 0.0
        return len(bodies)

    def clear(self, *, held_too: bool = False) -> int:
        """Take away all objects that are not held, or what hangs on the jaws too; returns how many."""
        held = set() if held_too else set(self.held())
        kept = [pair for pair in zip(self.scene.bodies, self.object_ids, strict=True) if pair[0] in held]
        gone = [body for body in self.scene.bodies if body not in held]
        for body in gone:
            self.scene.remove(body)
        self.object_ids = [name for _, name in kept]
        self._still_s = 0.0
        return len(gone)

    def exchange(self, *, held_too: bool = False) -> int:
        """Take objects away as :meth:`clear` does, and drop others of the set; returns how many."""
        self.clear(held_too=held_too)
        names = list(self.object_ids)
        count = self.config.objects_per_scene - len(names)
        others = [model for model in self._models if model.object_id not in names]
        chosen = [others[index] for index in self._rng.choice(len(others), size=count, replace=False)]
        self.scene.drop(chosen, self._rng, Randomization())
        for body in self.scene.bodies[len(names) :]:
            self.scene.put(body, self._free_place(body), random_rotation(self._rng))
        self.object_ids = [*names, *(model.object_id for model in chosen)]
        self._still_s = 0.0
        return count

    def _free_place(self, body: int) -> list[float]:
        others = [
            position
            for other, position in zip(self.scene.bodies, self.scene.poses()[:, :3], strict=True)
            if other != body
        ]
        # Nobody drops an object onto the arm.
        hand_xy_m = self.arm.hand.pose_base_tool[:2, 3]
        place = np.zeros(3)
        for number in range(PLACES):
            layer = number // (PLACES // 4)
            x_m, y_m = self.config.workspace.sample(self._rng)
            place = np.array([x_m, y_m, self.config.drop_height_m + layer * DROP_SPACING_M])
            clear = np.linalg.norm(place[:2] - hand_xy_m) > HAND_CLEARANCE_M
            if clear and all(np.linalg.norm(place[:2] - other[:2]) > DROP_SPACING_M for other in others):
                break
        return [float(value) for value in place]

    def put(self, index: int, position_m: tuple[float, float, float], angle_rad: float = 0.0) -> None:
        """Put one object somewhere, turned about the vertical: how tests lay out a table."""
        body = self.scene.bodies[index]
        turn = (0.0, 0.0, math.sin(0.5 * angle_rad), math.cos(0.5 * angle_rad))
        self.scene.put(body, position_m, turn)
        self._still_s = 0.0

    def close(self) -> None:
        """Stop the client and delete its files."""
        self._clients.close()
        self._folder.cleanup()
