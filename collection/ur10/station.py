"""The UR10 rig as a station: the paper's cycle on real devices (sections III-B and V-C).

A phase that fails raises; the attempt is recorded as aborted and carries no label. The next attempt begins with the
recovery from whatever it was, or with a pause that ends the session and waits for a person.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.collection.attempt import is_held
from handsight.collection.errors import (
    CameraLostError,
    DeviceError,
    DeviceFaultError,
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
from handsight.collection.ur10.between import BetweenAttempts
from handsight.collection.ur10.calibration import Calibration, check_calibration
from handsight.collection.ur10.camera import Camera
from handsight.collection.ur10.gripper import Gripper, GripResult, gripper_for
from handsight.collection.ur10.logs import Heartbeat, OperatorLog, append_line, now
from handsight.collection.ur10.poses import matrix_of
from handsight.collection.ur10.reach import reached_workspace
from handsight.collection.ur10.recovery import Recovery
from handsight.collection.ur10.rectify import Rectifier
from handsight.collection.ur10.rig import RigConfig
from handsight.datasets.records import RgbdFrame, StationSpec
from handsight.servoing.planar import PlanarPose

MOVED_M = 0.003
"""A tool that is this far away after a picture from before it did not stand."""


class Ur10Station:
    """A :class:`~handsight.collection.station.Station` on the rig; opening it connects to everything.

    Args:
        rig: The rig, with what was measured of it.
        calibration: Of its camera, and of where its arm reaches.
        spec: What stays fixed during a session.
        data_folder: Where the data go; its disk is watched.

    Raises:
        DeviceError: A device is missing.
        RigSettingsError: Another camera is mounted than was calibrated.
    """

    def __init__(
        self,
        rig: RigConfig,
        calibration: Calibration,
        spec: StationSpec,
        *,
        data_folder: Path | None = None,
    ) -> None:
        self._rig, self._spec = rig, spec
        self._workspace = reached_workspace(rig.workspace, calibration.reach)
        camera = check_calibration(calibration, rig.calibration, rig.camera.serial)
        self._rectifier = Rectifier(camera.intrinsics, camera.rotation)
        self.log = OperatorLog(rig.operator_log)
        self._heartbeat = Heartbeat(rig.heartbeat)
        self.arm = Arm(rig, table_height_m=rig.workspace.table_height_m)
        self.camera = Camera(rig.camera, note=lambda text: self.log.note("camera", step=text))
        self.gripper: Gripper = gripper_for(rig.gripper)
        self.recovery = Recovery(rig, self.arm, self.gripper, self.log)
        self._between = BetweenAttempts(rig, self.arm, self.gripper, self.log, data_folder=data_folder)
        self._fault = "begin"  # The last session may have ended low.
        self._camera_lost = self._holding = False
        self._last_s: float | None = None
        self._clock_s = 0.0
        self._grip: GripResult | None = None
        self._attempts = 0
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
            # Drawn whether or not it is used: the stream shall not depend on what was held.
            place = self._random_place(rng)
            self._between.guard(self._readings)
            if self._holding:
                self._between.put_down(place)
            self._between.measure_jaws(self._attempts)
            self._grip, self._holding = self.gripper.open(), False
            self._between.go_home()

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
                self._between.watch_table(frame, self._spec, self._readings)
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

    def _random_place(self, rng: np.random.Generator) -> PlanarPose:
        x_m, y_m = self._workspace.sample(rng)
        return PlanarPose(x_m=x_m, y_m=y_m, angle_rad=float(rng.uniform(-0.5 * math.pi, 0.5 * math.pi)))

    def _recover(self) -> None:
        self._heartbeat.beat("recovering", cause=self._fault)
        if self._camera_lost:
            raise RigPausedError(f"{self._fault}; look at the camera and its cable, then go on with --resume")
        self.recovery.recover(self._fault)
        self._fault, self._holding = "", False

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
            self._camera_lost = phase == "look" and isinstance(error, CameraLostError)
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
