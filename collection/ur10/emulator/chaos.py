"""Faults at random: what a week does to a rig, drawn from a seed.

Only what a rig can recover from by itself is drawn; buttons that a person presses are not. How long they last, and
what cures a camera, is drawn too.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from handsight.collection.ur10.emulator.faults import PHASES, Fault

DRAWN = (
    "drop",
    "freeze",
    "kill-controller",
    "protective-stop",
    "gripper-fault",
    "gripper-silent",
    "gripper-reset",
    "slip",
    "camera-dropout",
    "camera-frozen",
    "camera-stale",
    "camera-black",
    "camera-no-depth",
)
MINOR_AND_MAJOR = (5, 10, 14)
"""FLT codes: delayed action, too little voltage, too much current. Heat takes a pause."""
CAMERA_CURES = ("restart", "reset")


class Chaos:
    """Arms one fault after the other."""

    def __init__(self, per_hour: float, seed: int, arm: Callable[[Fault], None]) -> None:
        """Begin with the rig's clock at 0.

        Args:
            per_hour: Faults in an hour of robot time, on average.
            seed: Of what, when and how.
            arm: Takes each.
        """
        self._mean_s = 3600.0 / per_hour
        self._rng = np.random.default_rng([seed, 911])
        self._arm = arm
        self._next_s = float(self._rng.exponential(self._mean_s))

    def tick(self, clock_s: float) -> None:
        """Arm what is due at this time of the robot's clock."""
        while clock_s >= self._next_s:
            self._next_s += float(self._rng.exponential(self._mean_s))
            self._arm(self._draw())

    def _draw(self) -> Fault:
        name = str(self._rng.choice(DRAWN))
        values: dict[str, str] = {}
        if name in ("freeze", "kill-controller", "gripper-silent"):
            values["s"] = f"{self._rng.uniform(0.5, 6.0):.1f}"
        if name == "gripper-fault":
            values["code"] = str(self._rng.choice(MINOR_AND_MAJOR))
        if name.startswith("camera-"):
            values["cure"] = str(self._rng.choice(CAMERA_CURES))
        return Fault(name, values, str(self._rng.choice(PHASES)))
