"""The arm as the station sees it: moves that were checked, asked of a child that is supervised."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import PoseRefusedError
from handsight.collection.ur10.arm_client import OpenArm
from handsight.collection.ur10.arm_state import ArmState
from handsight.collection.ur10.child import SupervisedChild
from handsight.collection.ur10.contact import Touch
from handsight.collection.ur10.poses import MOST_TILT_RAD, check_pose, matrix_of, vector_of
from handsight.collection.ur10.rig import RigConfig

OPEN_S = 20.0
ANSWER_S = 5.0
MOVE_S = 60.0
"""Wall time that a move may take beyond what its length asks for: an emulator may be slower than the clock."""
SILENCE_S = 8.0
"""A move in which nothing was read for so long hangs in the library, as it does when a connection is lost."""
HALF_TURN_RAD = math.radians(170.0)


class Arm:
    """The UR10."""

    def __init__(self, rig: RigConfig, *, table_height_m: float, log: Path | None = None) -> None:
        """Nothing is connected yet.

        Args:
            rig: Addresses and limits.
            table_height_m: Height of the table top in the controller's base frame.
            log: File for what the library prints.
        """
        self.rig = rig
        self.table_height_m = table_height_m
        self.child = SupervisedChild("arm", OpenArm(rig.robot), open_timeout_s=OPEN_S, log=log)
        self._may_move = False

    def state(self) -> ArmState:
        """What the controller says now."""
        state: ArmState = self.child.ask("fresh_state", timeout_s=ANSWER_S)
        return state

    def take_control(self) -> None:
        """Get the arm ready to be moved; after a respawn or a stop again."""
        self.child.ask("take_control", timeout_s=OPEN_S)

    def pose_of(self, state: ArmState) -> NDArray[np.float64]:
        """Tool pose over the table, (4, 4): in the base frame with the table top at z = 0."""
        pose = matrix_of(list(state.tcp_pose))
        pose[2, 3] -= self.table_height_m
        return pose

    def move_to(
        self,
        pose_base_tool: NDArray[np.float64],
        *,
        speed_m_s: float | None = None,
        acceleration_m_s2: float | None = None,
        most_tilt_rad: float = MOST_TILT_RAD,
    ) -> NDArray[np.float64]:
        """Go to a pose over the table in a straight line; returns the pose measured there, shape (4, 4).

        A turn of nearly half a turn goes by its middle, so that the wrist turns back the way it came.

        Raises:
            PoseRefusedError: The pose is outside the limits; nothing moved.
            DeviceError: The move did not end there.
        """
        motion = self.rig.motion
        speed_m_s = min(speed_m_s or motion.speed_m_s, motion.speed_m_s)
        target = self._checked(pose_base_tool, most_tilt_rad)
        here = matrix_of(list(self.state().tcp_pose))
        for waypoint in (*_midway(here, target), target):
            state = self.child.ask(
                "move_line",
                vector_of(waypoint),
                speed_m_s,
                acceleration_m_s2 or motion.acceleration_m_s2,
                timeout_s=self._patience_s(here, waypoint, speed_m_s),
                silence_s=SILENCE_S,
            )
        return self.pose_of(state)

    def lift_straight(self, height_m: float, *, speed_m_s: float) -> NDArray[np.float64]:
        """Raise the tool straight up to a height over the table, from wherever it is; returns the pose there, (4, 4).

        Nothing is done where it is that high already. The only move that may begin and end beside the workspace.

        Raises:
            PoseRefusedError: The height is above the workspace.
            DeviceError: The move did not end there.
        """
        area = self.rig.workspace
        state = self.state()
        pose = self.pose_of(state)
        if pose[2, 3] >= height_m:
            return pose
        if not height_m <= area.overhead_height_m + area.margin_m:
            raise PoseRefusedError(f"height is {height_m} m, expected at most {area.overhead_height_m + area.margin_m}")
        vector = list(state.tcp_pose)
        vector[2] = height_m + self.table_height_m
        timeout_s = MOVE_S + 4.0 * (height_m - float(pose[2, 3])) / speed_m_s
        speed_m_s = min(speed_m_s, self.rig.motion.speed_m_s)
        acceleration_m_s2 = self.rig.motion.acceleration_m_s2
        state = self.child.ask(
            "move_line", vector, speed_m_s, acceleration_m_s2, timeout_s=timeout_s, silence_s=SILENCE_S
        )
        return self.pose_of(state)

    def descend(self, pose_base_tool: NDArray[np.float64]) -> Touch:
        """Go down to a pose over the table or until contact.

        Raises:
            PoseRefusedError: The pose is outside the limits; nothing moved.
            DeviceError: Neither was reached.
        """
        motion = self.rig.motion
        target = self._checked(pose_base_tool)
        here = matrix_of(list(self.state().tcp_pose))
        touch: Touch = self.child.ask(
            "descend",
            vector_of(target),
            motion.descend_speed_m_s,
            motion.acceleration_m_s2,
            motion.contact_force_n,
            motion.contact_samples,
            motion.baseline_s,
            motion.stop_acceleration_m_s2,
            timeout_s=self._patience_s(here, target, motion.descend_speed_m_s),
            silence_s=SILENCE_S,
        )
        return touch

    def allowed_by_controller(self, pose_base_tool: NDArray[np.float64]) -> bool:
        """Whether the controller's own limits allow a pose over the table."""
        return bool(self.child.ask("inside_limits", vector_of(self._checked(pose_base_tool)), timeout_s=ANSWER_S))

    def stop(self) -> None:
        """Brake."""
        if self.child.alive:
            self.child.ask("stop", self.rig.motion.stop_acceleration_m_s2, timeout_s=ANSWER_S)

    def close(self) -> None:
        """End the child; a move that is under way ends at its target."""
        self.child.close()

    def _checked(
        self, pose_base_tool: NDArray[np.float64], most_tilt_rad: float = MOST_TILT_RAD
    ) -> NDArray[np.float64]:
        pose = np.array(pose_base_tool, dtype=np.float64)
        if pose.shape == (4, 4):
            pose[2, 3] += self.table_height_m
        check_pose(self.rig, self.table_height_m, pose, most_tilt_rad=most_tilt_rad)
        return pose

    @staticmethod
    def _patience_s(here: NDArray[np.float64], there: NDArray[np.float64], speed_m_s: float) -> float:
        return MOVE_S + 4.0 * float(np.linalg.norm(here[:3, 3] - there[:3, 3])) / speed_m_s


def _midway(here: NDArray[np.float64], there: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """The pose halfway, where the turn between two poses is so near to half a turn that its direction is chance."""
    yaw_here, yaw_there = (math.atan2(pose[1, 0], pose[0, 0]) for pose in (here, there))
    if abs(yaw_there - yaw_here) < HALF_TURN_RAD:
        return []
    half = 0.5 * (yaw_there - yaw_here)
    cos, sin = math.cos(yaw_there - half), math.sin(yaw_there - half)
    middle = np.array([[cos, sin, 0.0, 0.0], [sin, -cos, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    middle[:3, 3] = 0.5 * (here[:3, 3] + there[:3, 3])
    return [middle]
