"""The simulated UR10: loads, moves by inverse kinematics under motor torque limits, carries the hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import PhaseAbortedError
from handsight.collection.sim.arm_model import ARM_JOINTS
from handsight.collection.sim.bullet import BulletClient, pybullet
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.hand import Hand
from handsight.collection.sim.kinematics import JOINT_LIMITS_RAD, REFERENCE_RAD, joints_for
from handsight.collection.sim.motion import careful, trapezoid

JOINT_EFFORT_NM = (330.0, 330.0, 150.0, 54.0, 54.0, 54.0)
JOINT_SPEED_RAD_S = 2.0
JOINT_ACCELERATION_RAD_S2 = 8.0
TOOL_SPEED_M_S = 0.4
TOOL_ACCELERATION_M_S2 = 3.0
KNOT_SPACING_M = 0.02
"""Inverse kinematics is solved this often along a line; between knots the joints run straight (error < 0.1 mm)."""
TRACKING_LIMIT_RAD = 0.03
"""A joint this far from where it was sent at the end of a move means that the arm was blocked."""

BASE_ORIENTATION = (0.0, 0.0, 1.0, 0.0)
"""Half a turn about z: puts the controller's base frame, in which poses are given, onto the world frame."""


class Arm:
    """The UR10 with its gripper in one PyBullet world; made anew for every attempt."""

    def __init__(self, bullet: BulletClient, urdf: Path, config: SimConfig) -> None:
        """Load the arm at ``REFERENCE_RAD`` with open jaws."""
        self._bullet = bullet
        self._config = config
        self.body: int = bullet.loadURDF(str(urdf), (0, 0, 0), BASE_ORIENTATION, useFixedBase=True)
        index = {bullet.getJointInfo(self.body, j)[1].decode(): j for j in range(bullet.getNumJoints(self.body))}
        self._joints = [index[name] for name in ARM_JOINTS]
        self._target_rad = REFERENCE_RAD
        self.hand = Hand(bullet, self.body, config)

    def place(self, pose_base_tool: NDArray[np.float64]) -> None:
        """Put the arm at a pose at once, at rest: how an attempt begins."""
        self._target_rad = joints_for(pose_base_tool, REFERENCE_RAD)
        for joint, angle_rad in zip(self._joints, self._target_rad, strict=True):
            self._bullet.resetJointState(self.body, joint, angle_rad)
        self.hand.extend()
        self._command(self._target_rad, np.zeros(6))

    def move_joints(self, pose_base_tool: NDArray[np.float64], step: Callable[[], None], *, phase: str) -> None:
        """Move to a pose along a straight line in joint space; every physics tick calls ``step``.

        Raises:
            UnreachableError: The pose is out of reach; nothing moved.
            PhaseAbortedError: The arm was blocked on the way.
        """
        start_rad = self._target_rad
        goal_rad = joints_for(pose_base_tool, start_rad, phase=phase)
        length_rad = float(np.abs(goal_rad - start_rad).max())
        path_rad = trapezoid(
            length_rad,
            speed=JOINT_SPEED_RAD_S,
            acceleration=JOINT_ACCELERATION_RAD_S2,
            rate_hz=self._config.physics_hz,
        )
        share = path_rad / length_rad if length_rad else np.ones_like(path_rad)
        self._follow(start_rad + share[:, None] * (goal_rad - start_rad), step)
        self._check_arrived(phase)

    def move_line(
        self,
        pose_base_tool: NDArray[np.float64],
        step: Callable[[], None],
        *,
        phase: str,
        stop: Callable[[], bool] | None = None,
        slow_from_m: float = math.inf,
    ) -> bool:
        """Move the fingertips along a straight line without turning; ``stop`` is asked after every physics tick.

        From ``slow_from_m`` along the line on they go no faster than ``SimConfig.touch_speed_m_s``.

        Returns:
            Whether ``stop`` ended the move early; the arm then holds where it is.

        Raises:
            UnreachableError: Some point of the line is out of reach; nothing moved.
            PhaseAbortedError: The arm was blocked on the way and ``stop`` did not say so.
        """
        path_rad = self._line(pose_base_tool, phase, slow_from_m)
        if self._follow(path_rad, step, stop):
            self.hold()
            return True
        self._check_arrived(phase)
        return False

    def hold(self) -> None:
        """Stop where the arm is now."""
        states = self._bullet.getJointStates(self.body, self._joints)
        self._target_rad = np.array([state[0] for state in states])
        self._command(self._target_rad, np.zeros(6))

    @property
    def joints_rad(self) -> NDArray[np.float64]:
        """Measured joint angles [rad]. Shape (6,)."""
        return np.array([state[0] for state in self._bullet.getJointStates(self.body, self._joints)])

    def follow(self, joints_rad: NDArray[np.float64], speed_rad_s: NDArray[np.float64]) -> None:
        """Have the motors go to these joint angles [rad], shape (6,), where somebody else plans the motion."""
        self._target_rad = joints_rad
        self._command(joints_rad, speed_rad_s)

    def _line(self, pose_base_tool: NDArray[np.float64], phase: str, slow_from_m: float) -> NDArray[np.float64]:
        """Joint angles at every tick of a straight-line move. Shape (K, 6)."""
        start = self.hand.pose_base_tool
        offset_m = pose_base_tool[:3, 3] - start[:3, 3]
        length_m = float(np.linalg.norm(offset_m))
        knots = max(2, int(np.ceil(length_m / KNOT_SPACING_M)) + 1)
        shares = np.linspace(0.0, 1.0, knots)
        joints_rad = [self._target_rad]
        for share in shares[1:]:
            knot = pose_base_tool.copy()
            knot[:3, 3] = start[:3, 3] + share * offset_m
            joints_rad.append(joints_for(knot, joints_rad[-1], phase=phase))
        ticks_m = careful(
            length_m,
            slow_from=slow_from_m,
            slow_speed=self._config.touch_speed_m_s,
            speed=TOOL_SPEED_M_S,
            acceleration=TOOL_ACCELERATION_M_S2,
            rate_hz=self._config.physics_hz,
        )
        table = np.stack(joints_rad)  # (knots, 6)
        columns = [np.interp(ticks_m, shares * length_m, table[:, axis]) for axis in range(6)]
        return np.stack(columns, axis=1)

    def _follow(
        self, path_rad: NDArray[np.float64], step: Callable[[], None], stop: Callable[[], bool] | None = None
    ) -> bool:
        speeds_rad_s = np.diff(path_rad, axis=0, prepend=self._target_rad[None]) * self._config.physics_hz
        for joints_rad, speed_rad_s in zip(path_rad, speeds_rad_s, strict=True):
            self._command(joints_rad, speed_rad_s)
            step()
            if stop is not None and stop():
                return True
        self._command(path_rad[-1], np.zeros(6))
        self._target_rad = path_rad[-1]
        return False

    def _command(self, joints_rad: NDArray[np.float64], speed_rad_s: NDArray[np.float64]) -> None:
        self._bullet.setJointMotorControlArray(
            self.body,
            self._joints,
            pybullet.POSITION_CONTROL,
            targetPositions=joints_rad.tolist(),
            targetVelocities=speed_rad_s.tolist(),
            forces=JOINT_EFFORT_NM,
            positionGains=[0.3] * 6,
            velocityGains=[1.0] * 6,
        )

    def _check_arrived(self, phase: str) -> None:
        states = self._bullet.getJointStates(self.body, self._joints)
        error_rad = np.abs(np.array([state[0] for state in states]) - self._target_rad)
        if error_rad.max() > TRACKING_LIMIT_RAD or (np.abs(self._target_rad) > JOINT_LIMITS_RAD).any():
            worst = int(error_rad.argmax())
            raise PhaseAbortedError(
                phase, f"the arm was blocked, {ARM_JOINTS[worst]} is {error_rad[worst]:.3f} rad from where it was sent"
            )
