"""The UR10 rig as a station: the paper's cycle on real devices (sections III-B and V-C).

A phase that fails raises; the attempt is recorded as aborted and carries no label. The next attempt begins with the
recovery from whatever it was, or with a pause that ends the session and waits for a person.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.collection.attempt import is_held
from handsight.collection.errors import (
    DeviceError,
    DeviceFaultError,
    DeviceLostError,
    PhaseAbortedError,
    PoseRefusedError,
    RigPausedError,
    RigSettingsError,
    RobotStoppedError,
    UnreachableError,
)
from handsight.collection.station import Descent, Workspace
from handsight.collection.ur10.alarm import sound_alarm
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.calibration import Calibration, check_calibration, load_calibration
from handsight.collection.ur10.camera import Camera
from handsight.collection.ur10.gripper import Gripper, GripResult, gripper_for
from handsight.collection.ur10.guards import disk_fault, height_over_table_m, temperature_fault
from handsight.collection.ur10.logs import Heartbeat, OperatorLog, append_line, now
from handsight.collection.ur10.poses import matrix_of
from handsight.collection.ur10.reach import check_reach, reached_workspace
from handsight.collection.ur10.recovery import Recovery
from handsight.collection.ur10.rectify import Rectifier
from handsight.collection.ur10.rig import RigConfig
from handsight.datasets.errors import counted
from handsight.datasets.records import RgbdFrame, StationSpec
from handsight.servoing.planar import PlanarPose

MOVED_M = 0.003
"""A tool that is this far away after a picture from before it did not stand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ur10StationFactory:
    """Opens the station of a rig; there is one arm, so one station at a time."""

    rig: RigConfig
    calibration: Calibration
    data_folder: Path | None = None
    """Where the data go; its disk is watched."""

    @classmethod
    def of(cls, rig: RigConfig, *, data_folder: Path | None = None) -> Ur10StationFactory:
        """The station of a rig with its calibration.

        Raises:
            RigSettingsError: The calibration is missing, damaged, or of another camera or workspace.
        """
        calibration = load_calibration(rig.calibration)
        check_calibration(calibration, rig.calibration, rig.camera.serial)
        if calibration.reach is not None:
            check_reach(calibration.reach, rig.workspace)
        return cls(rig=measured(rig, calibration), calibration=calibration, data_folder=data_folder)

    @property
    def spec(self) -> StationSpec:
        """The spec of every station it opens."""
        camera = check_calibration(self.calibration, self.rig.calibration, self.rig.camera.serial)
        return StationSpec(
            source="ur10",
            camera=camera.camera,
            depth_scale_m=camera.depth_scale_m,
            gripper_stroke_m=self.rig.gripper.stroke_m,
            closed_width_m=self.rig.gripper.closed_width_m,
            pregrasp_height_m=self.rig.workspace.pregrasp_height_m,
            serials={"camera": camera.serial, "robot": camera.robot, "gripper": self.rig.gripper.model},
        )

    @property
    def objects_per_scene(self) -> int:
        """Nobody knows what lies on the table."""
        return 0

    @property
    def pushable(self) -> bool:
        """Nobody stands at the table."""
        return False

    def settings(self) -> dict[str, object]:
        """Rig and calibration, as JSON values."""
        return {"rig": self.rig.to_json(), "calibration": self.calibration.to_json()}

    def __call__(self) -> Ur10Station:
        """Connect to everything.

        Raises:
            DeviceError: A device is missing.
            RigSettingsError: Another camera is mounted than was calibrated.
        """
        return Ur10Station(self)


def measured(rig: RigConfig, calibration: Calibration) -> RigConfig:
    """A rig with what was measured in the place of what its file has."""
    if calibration.table is not None:
        rig = replace(rig, workspace=replace(rig.workspace, table_height_m=calibration.table.height_m))
    if calibration.jaws is not None:
        jaws = calibration.jaws
        rig = replace(rig, gripper=replace(rig.gripper, open_count=jaws.open_count, closed_count=jaws.closed_count))
    if calibration.payload is not None:
        weighed = calibration.payload
        robot = replace(rig.robot, payload_kg=weighed.mass_kg, centre_of_mass_m=weighed.centre_of_mass_m)
        rig = replace(rig, robot=robot)
    return rig


class Ur10Station:
    """A :class:`~handsight.collection.station.Station` on the rig."""

    def __init__(self, factory: Ur10StationFactory, *, recover_first: bool = True) -> None:
        """Connect to everything, and lift the tool if the last session ended low; see the factory for errors."""
        rig = self._rig = factory.rig
        self._data_folder = factory.data_folder
        self._workspace = reached_workspace(rig.workspace, factory.calibration.reach)
        self._spec = factory.spec
        camera = check_calibration(factory.calibration, rig.calibration, rig.camera.serial)
        self._rectifier = Rectifier(camera.intrinsics, camera.rotation)
        self.log = OperatorLog(rig.operator_log)
        self._heartbeat = Heartbeat(rig.heartbeat)
        self.arm = Arm(rig, table_height_m=rig.workspace.table_height_m)
        self.camera = Camera(rig.camera, note=lambda text: self.log.note("camera", step=text))
        self.gripper: Gripper = gripper_for(rig.gripper)
        self.recovery = Recovery(rig, self.arm, self.gripper, self.log)
        self._fault = "begin" if recover_first else ""
        self._camera_lost = self._holding = False
        self._last_s: float | None = None
        self._clock_s = 0.0
        self._grip: GripResult | None = None
        self._attempts = self._empty_looks = 0
        self._readings: dict[str, Any] = {}
        try:
            self._check_camera(camera.serial)
        except BaseException:
            self.close()
            raise

    def _check_camera(self, serial: str) -> None:
        found = self.camera.description()
        if found.serial != serial:
            raise RigSettingsError(
                f"the camera on the rig is {found.serial}, and {serial} was calibrated: run 'rig calibrate camera'"
            )

    @property
    def spec(self) -> StationSpec:
        """What stays fixed during a session."""
        return self._spec

    @property
    def workspace(self) -> Workspace:
        """Where grasps are drawn."""
        return self._workspace

    @property
    def clock_s(self) -> float:
        """The controller's time since the attempt began [s]; it stands while the controller does not answer."""
        if self._fault:
            return self._clock_s
        try:
            now_s = self.arm.state().timestamp_s
        except DeviceError:
            return self._clock_s
        # A controller that was started anew counts from zero.
        self._clock_s += max(now_s - self._last_s, 0.0) if self._last_s is not None else 0.0
        self._last_s = now_s
        return self._clock_s

    @property
    def width_m(self) -> float:
        """Opening between the jaws, as last read [m]."""
        return math.nan if self._grip is None else self._grip.width_m

    def reset(self, rng: np.random.Generator) -> None:
        """Recover from what went wrong before, put down what is held at a random place, and go to the overhead pose.

        Raises:
            RigPausedError: A person has to come.
            PhaseError: The arm or the gripper fails on the way.
        """
        self._attempts += 1
        with self._paused_told():
            self._flush_readings()
            if self._fault:
                self._recover()
        self._clock_s, self._last_s = 0.0, None
        _ = self.clock_s
        with self._phase("settle"):
            self._guard()
            self._put_down(rng)
            self._measure_jaws()
            self._grip, self._holding = self.gripper.open(), False
            self._home()

    def look(self) -> RgbdFrame:
        """Take a picture and turn it parallel to the tool; the tool must stand.

        Raises:
            PhaseError: No usable picture, or the tool moved.
            RigPausedError: The table is empty.
        """
        with self._phase("look"):
            before = self.arm.pose_of(self.arm.state())
            picture = self.camera.picture()
            pose = self.arm.pose_of(self.arm.state())
            if float(np.linalg.norm(pose[:3, 3] - before[:3, 3])) > MOVED_M:
                raise DeviceError("the tool moved while the picture was taken")
            rgb, depth = self._rectifier.turned(picture.rgb, picture.depth)
        frame = RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=pose)
        self._readings.setdefault("depth_valid", []).append(round(picture.valid, 4))
        if pose[2, 3] > self._rig.workspace.overhead_height_m - 0.01:
            with self._paused_told():
                self._watch_table(frame)
        return frame

    def reach(self, pose: PlanarPose) -> None:
        """Move to ``pose`` at the pre-grasp height.

        Raises:
            UnreachableError: Our limits or the controller's do not allow it; nothing moved.
            PhaseError: The arm did not arrive.
        """
        target = pose.pose_base_tool(self._rig.workspace.pregrasp_height_m)
        with self._phase("reach"):
            self._leave_room_to_shake(pose)
            if not self.arm.allowed_by_controller(target):
                raise PoseRefusedError(f"({pose.x_m:.3f}, {pose.y_m:.3f}) m is outside the controller's safety limits")
            self.arm.move_to(target)

    def descend(self) -> Descent:
        """Straight down until the fingertips are just above the table, or until contact."""
        with self._phase("descend"):
            target = self._here()
            target[2, 3] = self._rig.workspace.clearance_m
            touch = self.arm.descend(target)
            self._readings["descent"] = {
                "contact": touch.contact, "force_n": touch.force_n, "baseline_n": touch.baseline_n
            }  # fmt: skip
        pose = matrix_of(list(touch.tcp_pose))
        pose[2, 3] -= self.arm.table_height_m
        return Descent(contact_force_n=touch.force_n, pose_base_tool=pose)

    def close_gripper(self) -> float:
        """Close the jaws and return their opening [m]."""
        with self._phase("close"):
            self._grip = self.gripper.close()
            self._keep("closed")
        return self._grip.width_m

    def lift(self) -> float:
        """Raise the tool to the lift height and return the jaws' opening [m]."""
        with self._phase("lift"):
            self.arm.lift_straight(self._rig.workspace.lift_height_m, speed_m_s=self._rig.motion.lift_speed_m_s)
            self._grip = self.gripper.read()
            self._keep("lifted")
        return self._grip.width_m

    def shake(self) -> float:
        """Shake the tool across the grip and return the jaws' opening [m]: what the label is told from."""
        with self._phase("shake"):
            rest = self._here()
            motion = self._rig.motion
            for _ in range(motion.shakes):
                for offset_m in (motion.shake_m, -motion.shake_m):
                    goal = rest.copy()
                    goal[:3, 3] += offset_m * rest[:3, 1]
                    self.arm.move_to(goal, speed_m_s=motion.shake_speed_m_s)
            self.arm.move_to(rest, speed_m_s=motion.shake_speed_m_s)
            self._grip = self.gripper.read()
            self._holding = is_held(self._grip.width_m, self._spec.closed_width_m)
            self._keep("shaken")
        return self._grip.width_m

    def held_in_truth(self) -> bool | None:
        """Nobody can tell."""
        return None

    def close(self) -> None:
        """Release everything; the arm stays where it is, the jaws too."""
        with suppress(RigPausedError):
            self._flush_readings()
        self.arm.close()
        self.camera.close()
        self.gripper.disconnect()

    def pause(self, reason: str) -> None:
        """Tell everybody that a person has to come: first who is outside, then the files, if they can be written."""
        failed = sound_alarm(self._rig.alarm, f"handsight rig {self._rig.robot.address} paused: {reason}")
        with suppress(RigPausedError):
            self._heartbeat.beat("paused", reason=reason)
            self.log.note("paused", reason=reason)
            for fault in failed:
                self.log.note("alarm failed", error=fault)

    def _leave_room_to_shake(self, pose: PlanarPose) -> None:
        area = self._rig.workspace
        beside_m = max(area.margin_m - self._rig.motion.shake_m, 0.0)
        for name, value, low, high in (
            ("x", pose.x_m, area.x_min_m, area.x_max_m),
            ("y", pose.y_m, area.y_min_m, area.y_max_m),
        ):
            if not low - beside_m <= value <= high + beside_m:
                raise PoseRefusedError(
                    f"{name} is {value:.3f} m, expected {low - beside_m:.3f} to {high + beside_m:.3f}"
                )

    # What attempts begin with.

    def _recover(self) -> None:
        self._heartbeat.beat("recovering", cause=self._fault)
        if self._camera_lost:
            raise RigPausedError(f"{self._fault}; look at the camera and its cable, then go on with --resume")
        self.recovery.recover(self._fault)
        self._fault, self._holding = "", False

    def _guard(self) -> None:
        state = self.arm.state()
        self._readings["temperatures_c"] = [round(value, 1) for value in state.temperatures_c]
        for fault in (
            temperature_fault(self._rig.guards, state.temperatures_c),
            "" if self._data_folder is None else disk_fault(self._rig.guards, self._data_folder),
        ):
            if fault:
                raise RigPausedError(fault)

    def _put_down(self, rng: np.random.Generator) -> None:
        """Carry what is held to a random place, lower it and let it fall; the stream is used alike if nothing is."""
        area = self._rig.workspace
        x_m, y_m = self._workspace.sample(rng)
        yaw_rad = rng.uniform(-0.5 * math.pi, 0.5 * math.pi)
        if not self._holding:
            return
        pose = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=float(yaw_rad))
        self.arm.move_to(pose.pose_base_tool(area.lift_height_m))
        self.arm.move_to(pose.pose_base_tool(area.drop_height_m))
        self._release()
        self.arm.move_to(pose.pose_base_tool(area.lift_height_m))

    def _release(self) -> None:
        """Open the jaws; shake once what sticks to them."""
        try:
            self._grip = self.gripper.open()
        except DeviceLostError:
            raise
        except DeviceError as error:
            self.log.note("jaws did not open", error=str(error))
            rest = self._here()
            for offset_m in (self._rig.motion.shake_m, 0.0):
                goal = rest.copy()
                goal[:3, 3] += offset_m * rest[:3, 0]
                self.arm.move_to(goal)
            self._grip = self.gripper.open()

    def _measure_jaws(self) -> None:
        """The closed position anew, now and then: pads wear."""
        every = self._rig.gripper.remeasure_every
        if not every or self._attempts % every:
            return
        found = self.gripper.measure_closed()
        drift = found - self._rig.gripper.closed_count
        self.log.note("closed position measured", count=found, drift=drift)
        if abs(drift) > 3 * max(self._rig.gripper.margin_counts, 1):
            raise RigPausedError(
                f"the jaws close at {found} counts, calibrated were {self._rig.gripper.closed_count}: look at the "
                "pads, then run 'rig calibrate gripper'"
            )
        self.gripper.closed_count = found

    def _home(self) -> None:
        area = self._rig.workspace
        self.arm.lift_straight(area.pregrasp_height_m, speed_m_s=self._rig.motion.lift_speed_m_s)
        x_m, y_m = area.centre_m
        home = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=0.0)
        self.arm.move_to(home.pose_base_tool(area.overhead_height_m))

    def _watch_table(self, frame: RgbdFrame) -> None:
        guards = self._rig.guards
        if not guards.empty_looks:
            return
        height_m = height_over_table_m(frame.depth, self._spec.depth_scale_m, self._spec.camera, frame.pose_base_tool)
        self._readings["highest_m"] = round(height_m, 4)
        self._empty_looks = self._empty_looks + 1 if height_m < guards.objects_height_m else 0
        if self._empty_looks >= guards.empty_looks:
            raise RigPausedError(
                f"nothing on the table stands higher than {height_m:.3f} m in {counted(self._empty_looks, 'picture')}: "
                "refill it"
            )

    @contextmanager
    def _paused_told(self) -> Iterator[None]:
        try:
            yield
        except RigPausedError as error:
            self.pause(str(error))
            raise

    # Errors of devices as those of phases.

    @contextmanager
    def _phase(self, phase: str) -> Iterator[None]:
        with self._paused_told(), self._failing(phase):
            self._heartbeat.beat("working", attempt=self._attempts, phase=phase)
            yield

    @contextmanager
    def _failing(self, phase: str) -> Iterator[None]:
        try:
            yield
        except PoseRefusedError as error:
            if phase != "reach":
                self._failed(phase, error)
            raise UnreachableError(phase, str(error)) from error
        except RobotStoppedError as error:
            self._failed(phase, error)
            if "emergency" in str(error) or "safeguard" in str(error):
                raise DeviceFaultError(phase, str(error)) from error
            raise PhaseAbortedError(phase, str(error)) from error
        except DeviceError as error:
            self._failed(phase, error)
            self._camera_lost = phase == "look" and "no usable picture" in str(error)
            raise DeviceFaultError(phase, str(error)) from error

    def _failed(self, phase: str, error: DeviceError) -> None:
        self._fault = f"{phase}: {error}"
        self._readings["failure"] = self._fault
        self.log.note("phase failed", phase=phase, error=str(error))

    def _here(self) -> NDArray[np.float64]:
        return self.arm.pose_of(self.arm.state())

    def _keep(self, moment: str) -> None:
        if self._grip is not None:
            self._readings[moment] = self._grip.raw

    def _flush_readings(self) -> None:
        """The raw readings of the attempt that is over, to the rig's own file."""
        if self._readings:
            append_line(self._rig.readings, {"at": now(), "of_this_process": self._attempts, **self._readings})
            self._readings = {}
