"""A rig's station that an onlooker watches: what the jaws truly hold, and what is done to the process in a phase."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from tests.support.emulated_rig import RunningRig

from handsight.collection.policy import Pregrasp
from handsight.collection.station import Station
from handsight.collection.ur10.station import Ur10Station
from handsight.collection.ur10.station_factory import Ur10StationFactory
from handsight.datasets.records import SceneObjects
from handsight.servoing.planar import PlanarPose

AtPhase = Callable[["WatchedStation", str], None]


def nothing(station: WatchedStation, phase: str) -> None:
    """Do nothing to the process."""


def holds(rig: RunningRig) -> bool:
    """Whether the jaws truly hold something off the table."""
    return any(one["held"] for one in rig.do("scene")["objects"])


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedFactory(Ur10StationFactory):
    """Opens the station of an emulated rig whose scene is looked at."""

    watched: RunningRig
    at_phase: AtPhase = field(default=nothing)
    """Called as a phase begins."""

    def __call__(self) -> WatchedStation:
        return WatchedStation(self)


class WatchedStation(Ur10Station):
    """Tells what the emulated jaws truly hold when the label is read."""

    def __init__(self, factory: WatchedFactory) -> None:
        self._watched, self._at_phase = factory.watched, factory.at_phase
        super().__init__(factory.rig, factory.calibration, factory.spec, data_folder=factory.data_folder)

    @property
    def holding(self) -> bool:
        """Whether the next attempt begins with something to put down."""
        return self._holding

    def held_in_truth(self) -> bool | None:
        try:
            return holds(self._watched)
        except (OSError, ValueError):
            return None  # The emulator was killed in this moment.

    @contextmanager
    def _phase(self, phase: str) -> Iterator[None]:
        with super()._phase(phase):
            self._at_phase(self, phase)
            yield


@dataclass(frozen=True, slots=True)
class AimedPolicy:
    """Grasps at an object of the emulated scene, in any direction: more is held than by chance over the table."""

    watched: RunningRig

    def settings(self) -> dict[str, object]:
        return {"name": "aimed"}

    def choose(self, station: Station, scene: SceneObjects | None, rng: np.random.Generator) -> Pregrasp:
        area = station.workspace
        objects: list[dict[str, Any]] = [one for one in self.watched.do("scene")["objects"] if not one["lost"]]
        drawn, angle_rad = rng.random(), float(rng.uniform(-0.5 * math.pi, 0.5 * math.pi))
        x_m, y_m = area.sample(rng)
        if objects:
            x_m, y_m = objects[int(drawn * len(objects))]["pose"][:2]
        return Pregrasp(pose=PlanarPose(x_m=float(x_m), y_m=float(y_m), angle_rad=angle_rad))
