"""The simulated UR10: loads, moves by inverse kinematics under motor torque limits, feels contact."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import PhaseAbortedError
from handsight.collection.sim.arm_model import ARM_JOINTS, FINGER_JOINTS, FLANGE_TO_TIP_M, GRIPPER_LINKS
from handsight.collection.sim.bullet import BulletClient, pybullet
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.kinematics import JOINT_LIMITS_RAD, REFERENCE_RAD, joints_for
from handsight.collection.sim.motion import trapezoid

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
        self._fingers = [index[name] for name in FINGER_JOINTS]
        self._flange = index["gripper_mount"]
        self._target_rad = REFERENCE_RAD
        self._set_up_fingers()

    def _set_up_fingers(self) -> None:
        links = {
            self._bullet.getJointInfo(self.body, j)[12].decode(): j for j in range(self._bullet.getNumJoints(self.body))
        }
        for name in GRIPPER_LINKS:
            self._bullet.changeDynamics(
                self.body,
                links[name],
                lateralFriction=self._config.finger_friction,
                spinningFriction=0.002,
                frictionAnchor=self._config.sticky_contacts,
            )
        # PyBullet ignores mimic tags; a gear keeps the jaws centred as the linkage of a real gripper does.
        gear = self._bullet.createConstraint(
            self.body, self._fingers[0], self.body, self._fingers[1], pybullet.JOINT_GEAR, (1, 0, 0), (0,) * 3, (0,) * 3
        )
        self._bullet.changeConstraint(gear, gearRatio=-1, erp=0.1, maxForce=2 * self._config.grip_force_n)
        for joint in self._fingers:
            self._bullet.resetJointState(self.body, joint, 0.5 * self._config.gripper_stroke_m)
        self.drive_fingers(opening_m_s=0.1)

    def drive_fingers(self, *, opening_m_s: float) -> None:
        """Run both jaws at this speed [m/s each], limited by the grip force; negative closes."""
        self._bullet.setJointMotorControlArray(
            self.body,
            self._fingers,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[opening_m_s] * 2,
            forces=[self._config.grip_force_n] * 2,
        )

    @property
    def width_m(self) -> float:
        """Opening between the jaws [m], as a gripper reports it: between closed and the stroke.

        Bullet's joint limits are soft, and fingers under load pass them by up to some millimetres.
        """
        states = self._bullet.getJointStates(self.body, self._fingers)
        return min(max(float(states[0][0] + states[1][0]), 0.0), self._config.gripper_stroke_m)

    @property
    def finger_speed_m_s(self) -> float:
        """Speed of the faster jaw [m/s]."""
        states = self._bullet.getJointStates(self.body, self._fingers)
        return max(abs(float(state[1])) for state in states)

    @property
    def pose_base_tool(self) -> NDArray[np.float64]:
        """Measured pose of the fingertips in the base frame. Shape (4, 4)."""
        state = self._bullet.getLinkState(self.body, self._flange, computeForwardKinematics=True)
        pose = np.eye(4)
        pose[:3, :3] = np.reshape(self._bullet.getMatrixFromQuaternion(state[5]), (3, 3))
        pose[:3, 3] = np.asarray(state[4]) + FLANGE_TO_TIP_M * pose[:3, 2]
        return pose

    @property
    def upward_force_n(self) -> float:
        """Vertical force that the world exerts on arm and gripper [N]."""
        # Field 7 is the contact normal on the other body, pointing towards the arm; field 9 its force.
        contacts = self._bullet.getContactPoints(bodyA=self.body)
        return float(sum(contact[7][2] * contact[9] for contact in contacts if contact[2] != self.body))

    def place(self, pose_base_tool: NDArray[np.float64]) -> None:
        """Put the arm at a pose at once, at rest: how an attempt begins."""
        self._target_rad = joints_for(pose_base_tool, REFERENCE_RAD)
        for joint, angle_rad in zip(self._joints, self._target_rad, strict=True):
            self._bullet.resetJointState(self.body, joint, angle_rad)
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
    ) -> bool:
        """Move the fingertips along a straight line without turning; ``stop`` is asked after every physics tick.

        Returns:
            Whether ``stop`` ended the move early; the arm then holds where it is.

        Raises:
            UnreachableError: Some point of the line is out of reach; nothing moved.
            PhaseAbortedError: The arm was blocked on the way and ``stop`` did not say so.
        """
        path_rad = self._line(pose_base_tool, phase)
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

    def _line(self, pose_base_tool: NDArray[np.float64], phase: str) -> NDArray[np.float64]:
        """Joint angles at every tick of a straight-line move. Shape (K, 6)."""
        start = self.pose_base_tool
        offset_m = pose_base_tool[:3, 3] - start[:3, 3]
        length_m = float(np.linalg.norm(offset_m))
        knots = max(2, int(np.ceil(length_m / KNOT_SPACING_M)) + 1)
        shares = np.linspace(0.0, 1.0, knots)
        joints_rad = [self._target_rad]
        for share in shares[1:]:
            knot = pose_base_tool.copy()
            knot[:3, 3] = start[:3, 3] + share * offset_m
            joints_rad.append(joints_for(knot, joints_rad[-1], phase=phase))
        ticks_m = trapezoid(
            length_m, speed=TOOL_SPEED_M_S, acceleration=TOOL_ACCELERATION_M_S2, rate_hz=self._config.physics_hz
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
