"""What the emulated devices act on: an arm that follows, jaws that close, something that presses back.

:class:`BareWorld` is geometry alone, for tests of protocols: an arm that follows exactly over an elastic table.
``physics.py`` has the one with objects.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.kinematics import REFERENCE_RAD
from handsight.collection.ur10.emulator.poses import FLANGE_TO_TIP, tcp_pose

TABLE_STIFFNESS_N_M = 4000.0


class World(Protocol):
    """Arm, jaws and what is around them."""

    @property
    def joints_rad(self) -> NDArray[np.float64]:
        """Measured joint angles [rad]. Shape (6,)."""

    @property
    def contact_n(self) -> NDArray[np.float64]:
        """What presses on arm and hand, in base axes [N]. Shape (3,)."""

    @property
    def width_m(self) -> float:
        """Opening between the jaws [m]."""

    @property
    def stroke_m(self) -> float:
        """Opening of the fully open jaws [m]."""

    @property
    def jaw_speed_m_s(self) -> float:
        """Speed of the jaws against each other [m/s], always positive."""

    @property
    def holds(self) -> bool:
        """Whether the jaws hold something off the table."""

    def advance(self, seconds: float, joints_rad: NDArray[np.float64]) -> None:
        """Let time pass, at the end of which the joints are sent to these angles [rad], shape (6,)."""

    def drive_jaws(self, speed_m_s: float) -> None:
        """Run the jaws against each other at this speed [m/s] until they meet something; negative closes, 0 holds."""

    def slip(self) -> bool:
        """Take what the jaws hold out of their grip; whether there was anything."""


class BareWorld:
    """No objects: an arm that follows exactly, jaws that run freely, a table that presses back like a spring."""

    def __init__(self, stroke_m: float = 0.085) -> None:
        self.joints_rad = REFERENCE_RAD.copy()
        self.width_m = self.stroke_m = stroke_m
        self.held_m = 0.0
        """Thickness of what the jaws meet when they close [m]."""
        self._speed_m_s = 0.0
        self.jaw_speed_m_s = 0.0

    @property
    def contact_n(self) -> NDArray[np.float64]:
        """See :class:`World`."""
        tip_z_m = tcp_pose(self.joints_rad, FLANGE_TO_TIP)[2, 3]
        return np.array([0.0, 0.0, TABLE_STIFFNESS_N_M * max(-tip_z_m, 0.0)])

    @property
    def holds(self) -> bool:
        """See :class:`World`."""
        return self.held_m > 0 and self.width_m <= self.held_m

    def advance(self, seconds: float, joints_rad: NDArray[np.float64]) -> None:
        """See :class:`World`."""
        self.joints_rad = joints_rad
        before_m = self.width_m
        low_m = min(self.held_m, before_m)
        self.width_m = min(max(before_m + self._speed_m_s * seconds, low_m), self.stroke_m)
        self.jaw_speed_m_s = abs(self.width_m - before_m) / seconds

    def drive_jaws(self, speed_m_s: float) -> None:
        """See :class:`World`."""
        self._speed_m_s = speed_m_s

    def slip(self) -> bool:
        """See :class:`World`."""
        held = self.held_m > 0
        self.held_m = 0.0
        return held
