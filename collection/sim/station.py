"""The simulated station: UR10, parallel gripper, hand camera and a table in PyBullet.

Every attempt starts from an empty bullet, so an attempt depends on its random generator alone and not on what the
worker did before: this is what makes attempts re-simulable bit for bit. Reloading the arm costs 6 ms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import ObjectSetError, SceneUnsettledError
from handsight.collection.sim.arm import Arm
from handsight.collection.sim.arm_model import temporary_arm_urdf
from handsight.collection.sim.camera import DAYLIGHT, render
from handsight.collection.sim.clearance import first_touch_m
from handsight.collection.sim.config import MOST_REDRAWS, TOUCH_MARGIN_M, SimConfig
from handsight.collection.sim.grippers import gripper_named
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.objects.model import ObjectModel
from handsight.collection.sim.randomization import Randomization, condition_names
from handsight.collection.sim.renderer import EmptyClients, renderer_named
from handsight.collection.sim.scene import Scene
from handsight.collection.sim.table import TABLE_FRICTION, add_table, wooden_table
from handsight.collection.station import Descent, LeftOver, Workspace
from handsight.datasets.errors import counted
from handsight.datasets.records import RgbdFrame, SceneObjects, StationSpec
from handsight.servoing.planar import PlanarPose

CLOSE_SPEED_M_S = 0.1
CLOSE_LIMIT_S = 1.0
ARM_CLEARANCE_M = 0.005
"""The descent ends where anything is so near to the arm above the hand: three physics ticks at full speed."""
STALLED_SPEED_M_S = 0.002
STALLED_TICKS = 6
TABLE_SEED = 0
UNSETTLED_SCENES = "unsettled_scenes"
"""The condition that counts the scenes that were drawn before one came to rest."""
SHAKE_AMPLITUDE_M = 0.03
LIFTED_M = 0.02
"""An object whose lowest point is this far above the table after the lift is off it: held in truth if a finger presses
on it, and falling otherwise. One finger is enough, for two objects can be held against each other."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimStationFactory:
    """Opens simulated stations in whichever process calls it."""

    config: SimConfig

    @property
    def spec(self) -> StationSpec:
        """The spec of every station it opens."""
        return StationSpec(
            source="sim",
            camera=self.config.camera,
            depth_scale_m=self.config.depth_scale_m,
            gripper_stroke_m=self.config.gripper_stroke_m,
            closed_width_m=self.config.closed_width_m,
            pregrasp_height_m=self.config.pregrasp_height_m,
            objects=tuple(model.object_id for model in load_object_set(self.config.objects)),
            conditions=(UNSETTLED_SCENES, *condition_names(self.config.vary, self.config.objects_per_scene)),
        )

    @property
    def objects_per_scene(self) -> int:
        """Objects dropped in every scene."""
        return self.config.objects_per_scene

    @property
    def pushable(self) -> bool:
        """A simulated object goes wherever it is put."""
        return True

    def settings(self) -> dict[str, object]:
        """The resolved configuration, as JSON values."""
        return self.config.to_json()

    def __call__(self) -> SimStation:
        """Start an bullet."""
        return SimStation(self.config)


def check_object_count(models: Sequence[ObjectModel], config: SimConfig) -> None:
    """Refuse a set that cannot fill a scene, in which every object is there once.

    Raises:
        ObjectSetError: It has too few objects.
    """
    if len(models) < config.objects_per_scene:
        raise ObjectSetError(
            f"object set {config.objects!r} has {counted(len(models), 'object')}, "
            f"expected at least the {config.objects_per_scene} of a scene; choose another set, or pass "
            f"--objects-per-scene {len(models)} or fewer"
        )


class SimStation:
    """A :class:`~handsight.collection.station.Station` in simulation."""

    def __init__(self, config: SimConfig) -> None:
        """Start a Bullet client of its own.

        Raises:
            ObjectSetError: Unknown object set, or fewer objects in it than a scene needs.
            RendererUnavailableError: This machine cannot draw with the renderer asked for.
        """
        self._config = config
        self._models = load_object_set(config.objects)
        check_object_count(self._models, config)
        self._spec = SimStationFactory(config=config).spec
        self._gripper = gripper_named(config.gripper)
        self._renderer = renderer_named(config.renderer)
        self._clients = EmptyClients(self._renderer)
        self._folder, self._arm_urdf = temporary_arm_urdf(self._gripper)
        self._wooden_table = self._table = wooden_table(np.random.default_rng(TABLE_SEED))
        self._ticks = 0

    @property
    def spec(self) -> StationSpec:
        """What stays fixed during a session."""
        return self._spec

    @property
    def workspace(self) -> Workspace:
        """Where objects are dropped."""
        return self._config.workspace

    @property
    def clock_s(self) -> float:
        """Simulated time since the scene was made [s]."""
        return self._ticks / self._config.physics_hz

    @property
    def width_m(self) -> float:
        """Opening between the jaws now [m]."""
        return self._arm.hand.width_m

    def reset(self, rng: np.random.Generator) -> SceneObjects:
        """Drop new objects and let them come to rest; the arm stands at the overhead pose.

        A scene that does not settle is drawn again from the same generator: it says nothing about who grasps. How
        many did not is the condition ``unsettled_scenes``.

        Raises:
            SceneUnsettledError: More than ``MOST_REDRAWS`` scenes in a row did not settle.
        """
        unsettled = 0
        while True:
            try:
                chosen, poses, target = self._draw_scene(rng)
                break
            except SceneUnsettledError as error:
                unsettled += 1
                if unsettled > MOST_REDRAWS:
                    raise SceneUnsettledError(
                        f"{error.reason}, and so it went in {counted(unsettled, 'scene')} of "
                        f"{counted(self._config.objects_per_scene, 'object')}; drop fewer, or raise settle_limit_s"
                    ) from error
        # The arm stands above what falls, untouched: it costs nothing while it is not there yet.
        self._add_arm()
        self._chosen = chosen
        return self._scene_objects(poses, target, unsettled)

    def go_on(self, rng: np.random.Generator, *, held: bool) -> LeftOver:
        """Prepare the next grasp in the same scene; see :class:`~handsight.collection.station.ClearingStation`.

        The arm is put there at once: on its way it would meet nothing.
        """
        gone = self._held_bodies() if held else []
        self._chosen = self._chosen[[body not in gone for body in self._scene.bodies]]
        for body in gone:
            self._scene.remove(body)
        self._bullet.setPhysicsEngineParameter(numSolverIterations=self._config.solver_iterations)
        self._arm.hand.place_fingers(self._config.gripper_stroke_m)
        self._arm.hand.drive_fingers(opening_m_s=CLOSE_SPEED_M_S)
        self._place_overhead()
        self._ticks += self._scene.settle()
        poses = self._scene.poses()
        scene = None
        if self._in_workspace(poses):
            scene = self._scene_objects(poses, self._choose_target(poses, rng), unsettled=0)
        return LeftOver(taken=len(gone), scene=scene)

    def _scene_objects(self, poses: NDArray[np.float64], target: int, unsettled: int) -> SceneObjects:
        return SceneObjects(
            catalogue_index=self._chosen.astype(np.int16),
            pose_base_object=poses,
            target=target,
            conditions=np.array([unsettled, *self._randomization.values()], dtype=np.float64),
        )

    def _draw_scene(self, rng: np.random.Generator) -> tuple[NDArray[np.int64], NDArray[np.float64], int]:
        """Objects dropped into an empty world and come to rest: which, shape (M,), where, (M, 7), and the target."""
        self._randomization = Randomization.draw(self._config.vary, self._config.objects_per_scene, rng.spawn(1)[0])
        self._reset_bullet()
        chosen = rng.choice(len(self._models), size=self._config.objects_per_scene, replace=False)
        self._scene.drop([self._models[index] for index in chosen], rng, self._randomization)
        self._ticks += self._scene.settle()
        poses = self._scene.poses()
        return chosen, poses, self._choose_target(poses, rng)

    def _reset_bullet(self) -> None:
        bullet = self._bullet = self._clients.empty()
        bullet.setGravity(0, 0, -9.81)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / self._config.physics_hz,
            numSolverIterations=self._config.solver_iterations,
            solverResidualThreshold=self._config.solver_residual,
            deterministicOverlappingPairs=1,
        )
        self._ticks = self._looks = 0
        friction = self._randomization.friction
        add_table(bullet, friction=TABLE_FRICTION if friction is None else friction.table)
        self._table = self._wooden_table if self._randomization.table is None else self._randomization.table.table_top()
        self._scene = Scene(bullet, self._config)

    def _add_arm(self) -> None:
        self._arm = Arm(self._bullet, self._arm_urdf, self._config)
        self._place_overhead()

    def _place_overhead(self) -> None:
        overhead = PlanarPose(x_m=self._centre[0], y_m=self._centre[1], angle_rad=0.0)
        self._arm.place(overhead.pose_base_tool(self._config.overhead_height_m))

    @property
    def _centre(self) -> tuple[float, float]:
        area = self._config.workspace
        return 0.5 * (area.x_min_m + area.x_max_m), 0.5 * (area.y_min_m + area.y_max_m)

    def _choose_target(self, poses: NDArray[np.float64], rng: np.random.Generator) -> int:
        inside = self._in_workspace(poses)
        if not inside:
            raise SceneUnsettledError("every object rolled out of the workspace")
        return int(rng.choice(inside))

    def _in_workspace(self, poses: NDArray[np.float64]) -> list[int]:
        """Which objects lie where they can be grasped."""
        area = self._config.workspace
        return [
            index
            for index, (x_m, y_m) in enumerate(poses[:, :2])
            if area.x_min_m <= x_m <= area.x_max_m and area.y_min_m <= y_m <= area.y_max_m
        ]

    def look(self) -> RgbdFrame:
        """Render the hand camera."""
        pose_base_tool = self._arm.hand.pose_base_tool
        noise = self._randomization.depth_noise
        rgb, depth = render(
            self._bullet,
            self._table,
            self._config.camera,
            pose_base_tool,
            depth_scale_m=self._config.depth_scale_m,
            light=DAYLIGHT if self._randomization.light is None else self._randomization.light.light(),
            renderer=self._renderer,
            sense=None if noise is None else partial(noise.measured, look=self._looks),
        )
        self._looks += 1
        return RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=pose_base_tool)

    def reach(self, pose: PlanarPose) -> None:
        """Move to ``pose`` at the pre-grasp height."""
        self._arm.move_joints(pose.pose_base_tool(self._config.pregrasp_height_m), self._step, phase="reach")

    def push(self, near_m: tuple[float, float], by_m: tuple[float, float]) -> None:
        """Slide the object nearest to a point of the table, and let everything come to rest; the arm stands still.

        Raises:
            SceneUnsettledError: Something still moves at ``settle_limit_s``.
        """
        self._ticks += self._scene.slide(self._scene.nearest(near_m), by_m)
        self._ticks += self._scene.settle()

    def descend(self) -> Descent:
        """Straight down to table height or until contact, slowly where contact is near, with a hand that yields."""
        hand = self._arm.hand
        start = hand.pose_base_tool
        goal = start.copy()
        goal[2, 3] = self._config.table_height_m
        touch_m = first_touch_m(self._bullet, self._gripper, start)
        slow_from_m = start[2, 3] - touch_m - TOUCH_MARGIN_M if touch_m > goal[2, 3] else math.inf
        force_n, felt = 0.0, False

        def touched() -> bool:
            nonlocal force_n, felt
            force_n = hand.contact_force_n
            felt = force_n >= self._config.contact_force_n
            return felt or hand.arm_clearance_m < ARM_CLEARANCE_M

        stopped = self._arm.move_line(goal, self._step, phase="descend", stop=touched, slow_from_m=slow_from_m)
        return Descent(
            contact_force_n=force_n if stopped else 0.0,
            pose_base_tool=hand.pose_base_tool,
            # Where no force ended the descent, something came too near to the arm, whatever the hand felt besides.
            touched_by="" if not stopped else hand.pressed_part if felt else "arm",
        )

    def close_gripper(self) -> float:
        """Close until the jaws stall or meet."""
        self._bullet.setPhysicsEngineParameter(numSolverIterations=self._config.grip_iterations)
        self._arm.hand.drive_fingers(opening_m_s=-CLOSE_SPEED_M_S)
        stalled = 0
        for _ in range(round(CLOSE_LIMIT_S * self._config.physics_hz)):
            self._step()
            stalled = stalled + 1 if self._arm.hand.finger_speed_m_s < STALLED_SPEED_M_S else 0
            if stalled >= STALLED_TICKS:
                break
        return self._arm.hand.width_m

    def lift(self) -> float:
        """Raise the tool to the lift height."""
        # Objects that were pushed and rest again need no solver; those in touch with the jaws wake up at once.
        self._scene.sleep()
        goal = self._arm.hand.pose_base_tool
        goal[2, 3] = self._config.lift_height_m
        self._arm.move_line(goal, self._step, phase="lift")
        return self._arm.hand.width_m

    def shake(self) -> float:
        """Shake along the tool's y axis, across the grip, as often as configured."""
        rest = self._arm.hand.pose_base_tool
        for _ in range(self._config.shakes):
            for offset_m in (SHAKE_AMPLITUDE_M, -SHAKE_AMPLITUDE_M):
                goal = rest.copy()
                goal[:3, 3] += offset_m * rest[:3, 1]
                self._arm.move_line(goal, self._step, phase="shake")
        self._arm.move_line(rest, self._step, phase="shake")
        return self._arm.hand.width_m

    def object_positions_m(self) -> NDArray[np.float64]:
        """Centres of mass of the objects. Shape (M, 3)."""
        return self._scene.poses()[:, :3]

    def held_in_truth(self) -> bool:
        """Whether some object is off the table with a finger pressing on it, gripper lifted."""
        return bool(self._held_bodies())

    def _held_bodies(self) -> list[int]:
        """Objects off the table that a finger presses on."""
        lifted = [body for body in self._scene.bodies if self._bullet.getAABB(body)[0][2] > LIFTED_M]
        return [body for body in lifted if self._arm.hand.touches(body)]

    def _step(self) -> None:
        self._bullet.stepSimulation()
        self._ticks += 1

    def close(self) -> None:
        """Stop the client and delete its temporary files."""
        self._clients.close()
        self._folder.cleanup()
