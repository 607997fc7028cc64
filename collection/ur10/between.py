"""What a rig does by itself between two attempts: guards, putting down what is held, measuring, going home."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from handsight.collection.errors import DeviceError, DeviceLostError, RigPausedError
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.gripper import Gripper
from handsight.collection.ur10.guards import disk_fault, height_over_table_m, temperature_fault
from handsight.collection.ur10.logs import OperatorLog
from handsight.collection.ur10.rig import RigConfig
from handsight.datasets.errors import counted
from handsight.datasets.records import RgbdFrame, StationSpec
from handsight.servoing.planar import PlanarPose


class BetweenAttempts:
    """The steps that no attempt is judged by.

    Args:
        rig: The rig.
        arm: Its arm.
        gripper: Its gripper.
        log: Where a person reads what was done.
        data_folder: Where the data go; its disk is watched.
    """

    def __init__(
        self, rig: RigConfig, arm: Arm, gripper: Gripper, log: OperatorLog, *, data_folder: Path | None
    ) -> None:
        self._rig, self._arm, self._gripper, self._log = rig, arm, gripper, log
        self._data_folder = data_folder
        self._empty_looks = 0

    def guard(self, readings: dict[str, Any]) -> None:
        """Look at temperatures and disk; what is read goes to the attempt's readings, also where it pauses the rig.

        Raises:
            RigPausedError: A joint is too hot, or the disk nearly full.
            DeviceError: The arm does not answer.
        """
        temperatures_c = self._arm.state().temperatures_c
        readings["temperatures_c"] = [round(value, 1) for value in temperatures_c]
        for fault in (
            temperature_fault(self._rig.guards, temperatures_c),
            "" if self._data_folder is None else disk_fault(self._rig.guards, self._data_folder),
        ):
            if fault:
                raise RigPausedError(fault)

    def put_down(self, pose: PlanarPose) -> None:
        """Carry what is held to a place, lower it and let it fall.

        Raises:
            DeviceError: The arm or the gripper fails on the way.
        """
        area = self._rig.workspace
        self._arm.move_to(pose.pose_base_tool(area.lift_height_m))
        self._arm.move_to(pose.pose_base_tool(area.drop_height_m))
        self._release()
        self._arm.move_to(pose.pose_base_tool(area.lift_height_m))

    def measure_jaws(self, attempts: int) -> None:
        """The closed position anew, every so many attempts: pads wear.

        Raises:
            RigPausedError: It has drifted further than pads wear.
            DeviceError: The jaws do not move.
        """
        every = self._rig.gripper.remeasure_every
        if not every or attempts % every:
            return
        found = self._gripper.measure_closed()
        drift = found - self._rig.gripper.closed_count
        self._log.note("closed position measured", count=found, drift=drift)
        if abs(drift) > 3 * max(self._rig.gripper.margin_counts, 1):
            raise RigPausedError(
                f"the jaws close at {found} counts, calibrated were {self._rig.gripper.closed_count}: look at the "
                "pads, then run 'rig calibrate gripper'"
            )
        self._gripper.closed_count = found

    def go_home(self) -> None:
        """Straight up, then to the overhead pose.

        Raises:
            DeviceError: The arm does not arrive.
        """
        area = self._rig.workspace
        self._arm.lift_straight(area.pregrasp_height_m, speed_m_s=self._rig.motion.lift_speed_m_s)
        x_m, y_m = area.centre_m
        home = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=0.0)
        self._arm.move_to(home.pose_base_tool(area.overhead_height_m))

    def watch_table(self, frame: RgbdFrame, spec: StationSpec, readings: dict[str, Any]) -> None:
        """Look for anything on the table; how high it stands goes to the attempt's readings.

        Raises:
            RigPausedError: Nothing lay there in as many pictures as the rig allows.
        """
        guards = self._rig.guards
        if not guards.empty_looks:
            return
        height_m = height_over_table_m(frame.depth, spec.depth_scale_m, spec.camera, frame.pose_base_tool)
        readings["highest_m"] = round(height_m, 4)
        self._empty_looks = self._empty_looks + 1 if height_m < guards.objects_height_m else 0
        if self._empty_looks >= guards.empty_looks:
            raise RigPausedError(
                f"nothing on the table stands higher than {height_m:.3f} m in {counted(self._empty_looks, 'picture')}: "
                "refill it"
            )

    def _release(self) -> None:
        """Open the jaws; shake once what sticks to them."""
        try:
            self._gripper.open()
        except DeviceLostError:
            raise
        except DeviceError as error:
            self._log.note("jaws did not open", error=str(error))
            rest = self._arm.pose_of(self._arm.state())
            for offset_m in (self._rig.motion.shake_m, 0.0):
                goal = rest.copy()
                goal[:3, 3] += offset_m * rest[:3, 0]
                self._arm.move_to(goal)
            self._gripper.open()
