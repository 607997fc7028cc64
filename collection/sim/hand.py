"""The hand on the wrist: a palm that yields along the tool axis, and two fingers that close.

A position-controlled arm of 30 kg that meets an object exerts whatever its motors give, hundreds of newtons within a
step. Here the hand hangs on the wrist by a slide with a weak motor, so that what it touches feels the weight of the
hand and that motor, and not the inertia of the arm: a stand-in for the compliance of a force-controlled robot. The end
of the slide's travel, not the motor, carries what the hand lifts. While the jaws close it also lets fingers ride up on
a thin object that they would otherwise squeeze into the table.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.arm_model import FINGER_JOINTS, GRIPPER_LINKS, HAND_JOINT
from handsight.collection.sim.bullet import BulletClient, pybullet
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.grippers import FLANGE_TO_TIP_M, gripper_named


class Hand:
    """Palm and fingers of the arm in one PyBullet world."""

    def __init__(self, bullet: BulletClient, body: int, config: SimConfig) -> None:
        """Set up the hand of the arm ``body``, jaws open and slide extended."""
        self._bullet = bullet
        self._body = body
        self._config = config
        self._stroke_m = gripper_named(config.gripper).stroke_m
        infos = [bullet.getJointInfo(body, joint) for joint in range(bullet.getNumJoints(body))]
        joints = {info[1].decode(): info[0] for info in infos}
        links = {info[12].decode(): info[0] for info in infos}
        self._fingers = [joints[name] for name in FINGER_JOINTS]
        self._slide: int = joints[HAND_JOINT]
        self._set_up_fingers([links[name] for name in GRIPPER_LINKS])
        self.extend()

    def _set_up_fingers(self, links: list[int]) -> None:
        for link in links:
            self._bullet.changeDynamics(
                self._body,
                link,
                lateralFriction=self._config.finger_friction,
                spinningFriction=0.002,
                frictionAnchor=self._config.sticky_contacts,
            )
        # PyBullet ignores mimic tags; a gear keeps the jaws centred as the linkage of a real gripper does.
        left, right = self._fingers
        gear = self._bullet.createConstraint(
            self._body, left, self._body, right, pybullet.JOINT_GEAR, (1, 0, 0), (0,) * 3, (0,) * 3
        )
        self._bullet.changeConstraint(gear, gearRatio=-1, erp=0.1, maxForce=2 * self._config.grip_force_n)
        self.place_fingers(self._stroke_m)
        self.drive_fingers(opening_m_s=0.1)

    def place_fingers(self, width_m: float) -> None:
        """Put the jaws at an opening at once."""
        for joint in self._fingers:
            self._bullet.resetJointState(self._body, joint, 0.5 * width_m)

    def drive_fingers(self, *, opening_m_s: float) -> None:
        """Run both jaws at this speed [m/s each], limited by the grip force; negative closes."""
        self._bullet.setJointMotorControlArray(
            self._body,
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
        states = self._bullet.getJointStates(self._body, self._fingers)
        return min(max(float(states[0][0] + states[1][0]), 0.0), self._stroke_m)

    @property
    def finger_speed_m_s(self) -> float:
        """Speed of the faster jaw [m/s]."""
        states = self._bullet.getJointStates(self._body, self._fingers)
        return max(abs(float(state[1])) for state in states)

    @property
    def retraction_m(self) -> float:
        """How far the hand has been pushed back towards the wrist [m]; 0 where nothing pushed it."""
        return -float(self._bullet.getJointState(self._body, self._slide)[0])

    @property
    def pose_base_tool(self) -> NDArray[np.float64]:
        """Measured pose of the fingertips in the base frame. Shape (4, 4)."""
        state = self._bullet.getLinkState(self._body, self._slide, computeForwardKinematics=True)
        pose = np.eye(4)
        pose[:3, :3] = np.reshape(self._bullet.getMatrixFromQuaternion(state[5]), (3, 3))
        pose[:3, 3] = np.asarray(state[4]) + FLANGE_TO_TIP_M * pose[:3, 2]
        return pose

    @property
    def contact_force_n(self) -> float:
        """What the world presses on arm and hand with, from all sides together [N].

        The sum of the normal forces of all contacts. Neither their vertical part alone, for a finger that slides down
        the flank of a thin object is pressed sideways, nor their vector sum, in which two fingers that wedge an
        object cancel.
        """
        return float(sum(contact[9] for contact in self._contacts()))

    @property
    def pressed_part(self) -> str:
        """What the world presses on hardest: ``finger``, ``palm`` or ``arm``; empty where it presses on nothing."""
        forces_n: Counter[str] = Counter()
        for contact in self._contacts():
            if contact[9] > 0:
                link = contact[3]
                part = "finger" if link in self._fingers else "palm" if link >= self._slide else "arm"
                forces_n[part] += contact[9]
        return max(forces_n, key=lambda part: forces_n[part], default="")

    @property
    def arm_clearance_m(self) -> float:
        """How near anything is to the arm above the hand [m], as far as Bullet looks ahead; infinite beyond.

        The arm does not yield as the hand does, so what it would touch is not left to be felt.
        """
        near_m = [contact[8] for contact in self._contacts() if 0 <= contact[3] < self._slide]
        return float(min(near_m, default=math.inf))

    @property
    def contact_n(self) -> NDArray[np.float64]:
        """Resultant of what the world does to arm and hand, friction included, in the base frame [N]. Shape (3,).

        What a force sensor in the flange feels beside the hand's own weight: jaws that squeeze an object cancel, and
        its weight remains.
        """
        total_n = np.zeros(3)
        for contact in self._contacts():
            # Bullet's normal points at the first body, its friction is what the first body does to the second.
            total_n += contact[9] * np.asarray(contact[7])
            total_n -= contact[10] * np.asarray(contact[11]) + contact[12] * np.asarray(contact[13])
        return total_n

    def _contacts(self) -> list[tuple[Any, ...]]:
        """Bullet's contacts of arm and hand with anything else."""
        contacts = self._bullet.getContactPoints(bodyA=self._body)
        return [contact for contact in contacts if contact[2] != self._body]

    def resist(self, force_n: float) -> None:
        """Have the slide give way at so much [N] beside the weight of the hand, from now on."""
        self._bullet.setJointMotorControl2(
            self._body,
            self._slide,
            pybullet.POSITION_CONTROL,
            targetPosition=0.0,
            force=force_n,
            positionGain=0.3,
            velocityGain=1.0,
        )

    def touches(self, body: int) -> bool:
        """Whether a finger presses on an object."""
        contacts = self._bullet.getContactPoints(bodyA=self._body, bodyB=body)
        return any(contact[3] in self._fingers and contact[9] > 0 for contact in contacts)

    def extend(self) -> None:
        """Put the slide where nothing pushes it, at once."""
        self._bullet.resetJointState(self._body, self._slide, 0.0)
        self.resist(self._config.yield_force_n)
