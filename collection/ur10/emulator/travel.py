"""Where the fingertips have been: what tells whether some move left the workspace."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handsight.collection.ur10.emulator.poses import FLANGE_TO_TIP, tcp_pose

WATCHED_EVERY_S = 0.008
"""Of robot time; the fingertips go 3 mm in it at most."""


class Travel:
    """The box around everywhere that the fingertips have been, over the table in the base frame."""

    def __init__(self, joints_rad: NDArray[np.float64]) -> None:
        """They are where these joint angles, shape (6,), have them."""
        self._unseen_s = 0.0
        self.forget(joints_rad)

    def forget(self, joints_rad: NDArray[np.float64]) -> None:
        """Begin anew from here."""
        self.low_m = self.high_m = _tips(joints_rad)

    def see(self, seconds: float, joints_rad: NDArray[np.float64]) -> None:
        """Take in where the fingertips are after so much time; some of the calls are left out."""
        self._unseen_s += seconds
        if self._unseen_s >= WATCHED_EVERY_S:
            self._unseen_s = 0.0
            here_m = _tips(joints_rad)
            self.low_m, self.high_m = np.minimum(self.low_m, here_m), np.maximum(self.high_m, here_m)


def _tips(joints_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    return tcp_pose(joints_rad, FLANGE_TO_TIP)[:3, 3]
