"""The seam between what attempts grasps and what records them.

A station is a robot with a camera and a gripper over a table, simulated or real. Each method is one phase of the
paper's cycle (sections III-B and V-B); each may fail, and then raises a :class:`~.errors.PhaseError` that says which
phase and why. Nothing here assumes that scenes can be reset, that truth is known, or that time is cheap.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.records import RgbdFrame, SceneObjects, StationSpec
from handsight.servoing.planar import PlanarPose


@dataclass(frozen=True, slots=True, kw_only=True)
class Workspace:
    """The part of the table where objects lie, in the base frame [m]."""

    x_min_m: float
    x_max_m: float
    y_min_m: float
    y_max_m: float

    def sample(self, rng: np.random.Generator) -> tuple[float, float]:
        """A uniformly drawn point (x, y) [m]."""
        return float(rng.uniform(self.x_min_m, self.x_max_m)), float(rng.uniform(self.y_min_m, self.y_max_m))


@dataclass(frozen=True, slots=True, kw_only=True)
class Descent:
    """How the vertical descent ended."""

    contact_force_n: float
    """Force on arm and gripper that ended it [N]; 0 when it ended at table height."""
    pose_base_tool: NDArray[np.float64]
    """Measured tool pose where it ended. Shape (4, 4)."""
    touched_by: str = ""
    """Which part of the robot met what ended it, ``finger``, ``palm`` or ``arm``; empty where nothing did, or where the
    station cannot tell."""


class Station(Protocol):
    """One robot, ready to attempt grasps."""

    @property
    def spec(self) -> StationSpec:
        """What stays fixed during a session."""

    @property
    def workspace(self) -> Workspace:
        """Where objects may lie."""

    @property
    def clock_s(self) -> float:
        """The station's own time [s]: simulated time, or the robot controller's."""

    @property
    def width_m(self) -> float:
        """Opening between the jaws now [m]."""

    def reset(self, rng: np.random.Generator) -> SceneObjects | None:
        """Reset the scene, with the arm at the pre-set overhead pose.

        A simulated station drops fresh objects and returns where they came to rest; a rig homes and returns None.
        """

    def look(self) -> RgbdFrame:
        """Take an RGB-D picture from where the camera is."""

    def reach(self, pose: PlanarPose) -> None:
        """Move to a pre-grasp pose at the station's pre-grasp height."""

    def descend(self) -> Descent:
        """Go straight down to table height or until contact."""

    def close_gripper(self) -> float:
        """Close the jaws and return their opening [m]."""

    def lift(self) -> float:
        """Raise the tool to the lift height and return the jaws' opening [m]."""

    def shake(self) -> float:
        """Shake the tool three times and return the jaws' opening [m]."""

    def held_in_truth(self) -> bool | None:
        """Whether an object is really held above the table; None where nobody can tell."""

    def close(self) -> None:
        """Release the station; it cannot be used afterwards."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOver:
    """A scene after a grasp."""

    taken: int
    """Objects that were taken away."""
    scene: SceneObjects | None
    """The objects left, with the next target drawn among those in reach; None where none is in reach."""


@runtime_checkable
class ClearingStation(Protocol):
    """A station whose scene stays for the next grasp, so that a table can be cleared."""

    def go_on(self, rng: np.random.Generator, *, held: bool) -> LeftOver:
        """Prepare the next grasp in the same scene, with the arm at the overhead pose and the jaws open.

        What the jaws hold is taken away if ``held`` says that the grasp succeeded, and falls otherwise.

        Raises:
            PhaseError: The objects left do not come to rest.
        """


@runtime_checkable
class SeesObjects(Protocol):
    """A station that knows where its objects are at any moment."""

    def object_positions_m(self) -> NDArray[np.float64]:
        """Centres of mass of the objects of the scene, in its order, in the base frame. Shape (M, 3)."""


@runtime_checkable
class Pushable(Protocol):
    """A station whose objects can be pushed, as somebody at the table would: for trials in which they do not stay."""

    def push(self, near_m: tuple[float, float], by_m: tuple[float, float]) -> None:
        """Shift one object along the table and let everything come to rest; the arm stands still.

        Args:
            near_m: The object nearest to this point of the table is shifted; (x, y) in the base frame [m].
            by_m: How far, (x, y) in the base frame [m].
        """
