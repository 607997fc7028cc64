"""Motions of the emulated arm: where the joints should be after the next control period.

Paths run with trapezoidal speed and brake along themselves, so that a stopped line stays a line.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handsight.collection.ur10.emulator.poses import joints_of, matrix_of, tcp_pose, vector_of

KNOT_SPACING_M = 0.02
KNOT_SPACING_RAD = 0.05
"""Inverse kinematics is solved so often along a line; between knots the joints run straight (error < 0.1 mm)."""
JOINT_SPEED_LIMIT_RAD_S = 3.14
"""Of the UR10's wrists; its base and shoulder turn 2.1 rad/s."""
SERVO_SHARE = 0.1
"""Share of the way to a servo target that is gone in one period."""


class Motion(Protocol):
    """One motion under way."""

    @property
    def finished(self) -> bool:
        """Whether the arm stands."""

    def advance(self, seconds: float) -> NDArray[np.float64]:
        """Joint angles [rad], shape (6,), one period later.

        Raises:
            UnreachableError: The motion leads where the arm cannot go.
        """

    def brake(self, deceleration: float, *, joints: bool) -> None:
        """Come to a stand at so much [rad/s2 of the fastest joint, or m/s2 of the tool], and be finished."""


class Path:
    """A motion along knots in joint space, with the path coordinate in metres or radians."""

    def __init__(
        self,
        shares: NDArray[np.float64],
        joints_rad: NDArray[np.float64],
        *,
        speed: float,
        acceleration: float,
        tcp_offset: NDArray[np.float64],
    ) -> None:
        """Start at the first knot; ``shares`` (K,) are path coordinates from 0 up, ``joints_rad`` is (K, 6)."""
        self._knots: list[float] = shares.tolist()
        self._joints_rad = joints_rad
        self._tcp_offset = tcp_offset
        self._speed = max(speed, 1e-6)
        self._acceleration = max(acceleration, 1e-6)
        self._length = float(shares[-1])
        self._at = self._now = 0.0
        self._deceleration: float | None = None
        self.finished = self._length <= 0.0

    @property
    def progress(self) -> float:
        """Share of the path that is done, 0 to 1."""
        return self._at / self._length if self._length > 0 else 1.0

    def advance(self, seconds: float) -> NDArray[np.float64]:
        """See :class:`Motion`."""
        if not self.finished:
            if self._deceleration is not None:
                self._now -= self._deceleration * seconds
                self.finished = self._now <= 0
                self._now = max(self._now, 0.0)
            else:
                gain = self._acceleration * seconds
                stopping = max(gain, math.sqrt(2 * self._acceleration * (self._length - self._at)))
                self._now = min(self._now + gain, self._speed, stopping)
            self._at += self._now * seconds
            if self._at >= self._length - 1e-9:
                self._at, self.finished = self._length, True
        return self._joints_at(self._at)

    def brake(self, deceleration: float, *, joints: bool) -> None:
        """See :class:`Motion`."""
        step = 1e-3 * self._length
        low, high = max(self._at - step, 0.0), min(self._at + step, self._length)
        before, after = self._joints_at(low), self._joints_at(high)
        if joints:
            moved = float(np.abs(after - before).max())
        else:
            ends = [tcp_pose(each, self._tcp_offset)[:3, 3] for each in (before, after)]
            moved = float(np.linalg.norm(ends[1] - ends[0]))
        per_unit = moved / max(high - low, 1e-12)
        self._deceleration = max(deceleration, 1e-3) / max(per_unit, 1e-3)
        self.finished = self.finished or self._now <= 0

    def _joints_at(self, at: float) -> NDArray[np.float64]:
        if at >= self._length or len(self._knots) < 2:
            return np.asarray(self._joints_rad[-1])
        index = max(bisect_right(self._knots, at) - 1, 0)
        share = (at - self._knots[index]) / (self._knots[index + 1] - self._knots[index])
        joints_rad: NDArray[np.float64] = (1 - share) * self._joints_rad[index] + share * self._joints_rad[index + 1]
        return joints_rad


def joint_path(
    start_rad: NDArray[np.float64],
    goal_rad: NDArray[np.float64],
    *,
    speed: float,
    acceleration: float,
    tcp_offset: NDArray[np.float64],
) -> Path:
    """Straight in joint space; speed and acceleration are of the joint that turns farthest [rad/s, rad/s2]."""
    length = float(np.abs(goal_rad - start_rad).max())
    knots = np.stack((start_rad, goal_rad))
    return Path(np.array([0.0, length]), knots, speed=speed, acceleration=acceleration, tcp_offset=tcp_offset)


def line_path(
    start_rad: NDArray[np.float64],
    goal: NDArray[np.float64],
    *,
    speed: float,
    acceleration: float,
    tcp_offset: NDArray[np.float64],
) -> Path:
    """The TCP straight to a pose, shape (4, 4), turning evenly; speed and acceleration in m/s and m/s2.

    Raises:
        UnreachableError: Some point of the line is out of reach.
    """
    start = tcp_pose(start_rad, tcp_offset)
    offset_m = goal[:3, 3] - start[:3, 3]
    turn = np.eye(4)
    turn[:3, :3] = start[:3, :3].T @ goal[:3, :3]
    turn_rad = vector_of(turn)[3:]
    length_m, angle_rad = float(np.linalg.norm(offset_m)), float(np.linalg.norm(turn_rad))
    # A turn on the spot counts as if at a radius of 0.1 m: the controller has its own limit on turning.
    length = max(length_m, 0.1 * angle_rad)
    if length < 1e-7:
        return Path(np.zeros(1), start_rad[None], speed=speed, acceleration=acceleration, tcp_offset=tcp_offset)
    count = max(2, math.ceil(length_m / KNOT_SPACING_M) + 1, math.ceil(angle_rad / KNOT_SPACING_RAD) + 1)
    shares = np.linspace(0.0, 1.0, count)
    joints_rad = [start_rad]
    for share in shares[1:]:
        knot = start @ matrix_of((0.0, 0.0, 0.0, *(share * turn_rad)))
        knot[:3, 3] = start[:3, 3] + share * offset_m
        joints_rad.append(joints_of(knot, tcp_offset, joints_rad[-1]))
    return Path(shares * length, np.stack(joints_rad), speed=speed, acceleration=acceleration, tcp_offset=tcp_offset)


class Velocity:
    """A commanded velocity of the joints or of the tool, until it is stopped."""

    def __init__(self, joints_rad: NDArray[np.float64], tcp_offset: NDArray[np.float64], *, joints: bool) -> None:
        self._joints_rad = joints_rad
        self._tcp_offset = tcp_offset
        self._of_joints = joints
        self._now = np.zeros(6)
        self._goal = np.zeros(6)
        self._acceleration = 0.5
        self._stopping = False
        self.finished = False

    def aim(self, velocity: NDArray[np.float64], acceleration: float) -> None:
        """Change to another velocity [rad/s, or m/s and rad/s], shape (6,), with so much acceleration."""
        self._goal, self._acceleration, self._stopping = velocity, max(acceleration, 1e-3), False

    def advance(self, seconds: float) -> NDArray[np.float64]:
        """See :class:`Motion`."""
        missing = self._goal - self._now
        far = float(np.linalg.norm(missing))
        step = self._acceleration * seconds
        self._now = self._goal.copy() if far <= step else self._now + missing * (step / far)
        if self._stopping and not self._now.any():
            self.finished = True
        if self._of_joints:
            self._joints_rad = self._joints_rad + self._now * seconds
        elif self._now.any():
            pose = tcp_pose(self._joints_rad, self._tcp_offset)
            turned = matrix_of((0.0, 0.0, 0.0, *(self._now[3:] * seconds)))
            pose[:3, :3] = turned[:3, :3] @ pose[:3, :3]
            pose[:3, 3] += self._now[:3] * seconds
            self._joints_rad = joints_of(pose, self._tcp_offset, self._joints_rad)
        return self._joints_rad

    def brake(self, deceleration: float, *, joints: bool) -> None:
        """See :class:`Motion`; the deceleration is taken in the units of the velocity."""
        del joints
        self._goal, self._acceleration, self._stopping = np.zeros(6), max(deceleration, 1e-3), True


class Servo:
    """The joints follow a target that is sent anew all the time."""

    def __init__(self, joints_rad: NDArray[np.float64]) -> None:
        self._joints_rad = joints_rad
        self._goal_rad = joints_rad
        self.finished = False

    def aim(self, joints_rad: NDArray[np.float64]) -> None:
        """Follow this target from now on [rad], shape (6,)."""
        self._goal_rad = joints_rad

    def advance(self, seconds: float) -> NDArray[np.float64]:
        """See :class:`Motion`."""
        limit = JOINT_SPEED_LIMIT_RAD_S * seconds
        self._joints_rad = self._joints_rad + np.clip(SERVO_SHARE * (self._goal_rad - self._joints_rad), -limit, limit)
        return self._joints_rad

    def brake(self, deceleration: float, *, joints: bool) -> None:
        """See :class:`Motion`; following is slow enough to end at once."""
        del deceleration, joints
        self.finished = True
