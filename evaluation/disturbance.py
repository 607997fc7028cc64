"""Stations that are not as their users believe: an error of calibration, or a worse depth camera.

What is disturbed is what the method is told, never what the station does, so that any station can be disturbed and a
trial begins as it does without. A disturbance answers whether closing the loop helps: a method that looks again after
every move can see that it has not arrived, one that looks once cannot.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from handsight.collection.collector import StationFactory
from handsight.collection.station import Descent, Station, Workspace
from handsight.datasets.records import RgbdFrame, SceneObjects, StationSpec
from handsight.evaluation.errors import EvaluationSettingsError
from handsight.servoing.planar import PlanarPose

Kind = Literal["hand-eye", "depth-noise"]
KINDS: Final[dict[str, str]] = {"hand-eye": "hand-eye:5mm", "depth-noise": "depth-noise:4mm"}
"""Each kind with an example of how it is written."""
LARGEST_MM: Final = 100.0
_WRITTEN: Final = re.compile(r"(hand-eye|depth-noise):([0-9]{1,3}(?:\.[0-9]{1,3})?)mm", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """One error, the same in every trial."""

    kind: Kind
    """``hand-eye``: the camera is believed to sit beside where it is, in a direction drawn for each trial.
    ``depth-noise``: Gaussian noise on every valid pixel of every depth picture."""
    size_m: float
    """Distance of the camera from where it is believed to be, or standard deviation of the depth [m]."""

    @classmethod
    def parse(cls, text: str) -> Disturbance:
        """The disturbance that is written as in ``KINDS``.

        Raises:
            EvaluationSettingsError: There is no such kind, or its size is none.
        """
        written = _WRITTEN.fullmatch(text.strip())
        size_mm = float(written[2]) if written else 0.0
        if written is None or not 0 < size_mm <= LARGEST_MM:
            raise EvaluationSettingsError(
                f"disturb is {text!r}, expected a kind and its size, more than 0 and at most {LARGEST_MM:g} mm: "
                f"{' or '.join(KINDS.values())}"
            )
        return cls(kind="hand-eye" if written[1] == "hand-eye" else "depth-noise", size_m=size_mm / 1000)

    def __str__(self) -> str:
        return f"{self.kind}:{1000 * self.size_m:g}mm"


@dataclass(frozen=True, slots=True, kw_only=True)
class DisturbedFactory:
    """Opens disturbed stations in any process."""

    open_station: StationFactory
    disturbance: Disturbance

    @property
    def spec(self) -> StationSpec:
        """The spec of every station before a trial disturbs it."""
        return self.open_station.spec

    @property
    def objects_per_scene(self) -> int:
        """Largest number of objects in a scene."""
        return self.open_station.objects_per_scene

    def settings(self) -> dict[str, object]:
        """Those of the station, and the disturbance."""
        return {**self.open_station.settings(), "disturbance": str(self.disturbance)}

    def __call__(self) -> DisturbedStation:
        """Open a station."""
        return DisturbedStation(self.open_station(), self.disturbance)


class DisturbedStation:
    """A station that tells what is not quite so; its phases are those of the station behind it."""

    def __init__(self, station: Station, disturbance: Disturbance) -> None:
        self._station = station
        self._disturbance = disturbance
        self._spec = station.spec
        self._noise = np.random.default_rng(0)

    @property
    def spec(self) -> StationSpec:
        """What is believed of the station in this trial."""
        return self._spec

    @property
    def workspace(self) -> Workspace:
        """Where objects may lie."""
        return self._station.workspace

    @property
    def clock_s(self) -> float:
        """The station's own time [s]."""
        return self._station.clock_s

    @property
    def width_m(self) -> float:
        """Opening between the jaws now [m]."""
        return self._station.width_m

    def reset(self, rng: np.random.Generator) -> SceneObjects | None:
        """The scene that there is without disturbance; the error is drawn from a stream of its own afterwards."""
        scene = self._station.reset(rng)
        self._noise = rng.spawn(1)[0]
        self._spec = self._station.spec
        if self._disturbance.kind == "hand-eye":
            angle_rad = self._noise.uniform(0, 2 * np.pi)
            camera = self._spec.camera
            self._spec = replace(
                self._spec,
                camera=replace(
                    camera,
                    x_tool_camera_m=camera.x_tool_camera_m + self._disturbance.size_m * float(np.cos(angle_rad)),
                    y_tool_camera_m=camera.y_tool_camera_m + self._disturbance.size_m * float(np.sin(angle_rad)),
                ),
            )
        return scene

    def look(self) -> RgbdFrame:
        """The picture, its depth with noise where that is the disturbance; invalid pixels stay invalid."""
        frame = self._station.look()
        if self._disturbance.kind != "depth-noise":
            return frame
        deviation = self._disturbance.size_m / self._spec.depth_scale_m
        noisy = np.rint(frame.depth + self._noise.normal(0, deviation, frame.depth.shape))
        valid = np.clip(noisy, 1, np.iinfo(frame.depth.dtype).max).astype(frame.depth.dtype)
        return replace(frame, depth=np.where(frame.depth > 0, valid, frame.depth))

    def reach(self, pose: PlanarPose) -> None:
        """Move to a pre-grasp pose."""
        self._station.reach(pose)

    def descend(self) -> Descent:
        """Go straight down to table height or until contact."""
        return self._station.descend()

    def close_gripper(self) -> float:
        """Close the jaws and return their opening [m]."""
        return self._station.close_gripper()

    def lift(self) -> float:
        """Raise the tool and return the jaws' opening [m]."""
        return self._station.lift()

    def shake(self) -> float:
        """Shake the tool and return the jaws' opening [m]."""
        return self._station.shake()

    def held_in_truth(self) -> bool | None:
        """Whether an object is really held."""
        return self._station.held_in_truth()

    def close(self) -> None:
        """Release the station."""
        self._station.close()
