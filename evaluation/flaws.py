"""What is wrong with a station in one trial: drawn when the trial begins, the same whatever is then done."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handsight.collection.depth_noise import DepthNoise
from handsight.datasets.records import RgbdFrame, StationSpec
from handsight.evaluation.turned_camera import random_turn, turned_frame


class Flaw:
    """What can be wrong; each kind overrides its part, and here nothing is."""

    def believed(self, spec: StationSpec) -> StationSpec:
        """What is believed of a station whose spec is another."""
        return spec

    def seen(self, frame: RgbdFrame, spec: StationSpec, look: int) -> RgbdFrame:
        """The frame that is told in place of the one that was taken.

        Args:
            frame: As it was taken.
            spec: Of the station.
            look: Which frame of the trial it is, counted from 0.
        """
        return frame

    @property
    def push_m(self) -> tuple[float, float] | None:
        """How far an object is pushed after the first servo move, (x, y) in the base frame [m]; None for not."""
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class ShiftedCamera(Flaw):
    """The camera is believed to sit beside where it is, at its height."""

    x_m: float
    """How far along the tool's x axis [m]."""
    y_m: float

    @classmethod
    def draw(cls, distance_m: float, rng: np.random.Generator) -> ShiftedCamera:
        """In any direction."""
        x_m, y_m = _any_direction(distance_m, rng)
        return cls(x_m=x_m, y_m=y_m)

    def believed(self, spec: StationSpec) -> StationSpec:
        """The same camera in another place."""
        camera = spec.camera
        shifted = replace(
            camera, x_tool_camera_m=camera.x_tool_camera_m + self.x_m, y_tool_camera_m=camera.y_tool_camera_m + self.y_m
        )
        return replace(spec, camera=shifted)


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnedCamera(Flaw):
    """The camera is turned about its centre, and believed to look straight down as ever."""

    turned_from_camera: NDArray[np.float64]
    """From the axes believed to those of the camera. Shape (3, 3)."""

    @classmethod
    def draw(cls, angle_rad: float, rng: np.random.Generator) -> TurnedCamera:
        """About any axis."""
        return cls(turned_from_camera=random_turn(angle_rad, rng))

    def seen(self, frame: RgbdFrame, spec: StationSpec, look: int) -> RgbdFrame:
        """What the turned camera sees from there."""
        return turned_frame(frame, spec.camera.intrinsics, self.turned_from_camera)


@dataclass(frozen=True, slots=True, kw_only=True)
class NoisyDepth(Flaw):
    """Gaussian noise on every valid pixel of every depth picture."""

    deviation_m: float
    rng: np.random.Generator

    def seen(self, frame: RgbdFrame, spec: StationSpec, look: int) -> RgbdFrame:
        """Valid pixels stay valid, invalid ones invalid."""
        deviation = self.deviation_m / spec.depth_scale_m
        return _with_depth(frame, frame.depth + self.rng.normal(0, deviation, frame.depth.shape), frame.depth > 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class StereoDepth(Flaw):
    """Depth as a stereo camera measures it; see :mod:`handsight.collection.depth_noise`."""

    noise: DepthNoise

    def seen(self, frame: RgbdFrame, spec: StationSpec, look: int) -> RgbdFrame:
        """What the stereo camera makes of the depth; what is invalid stays so, and more of it is."""
        valid = frame.depth > 0
        if not valid.any():
            return frame
        # Where nothing is known is taken to be as far as the rest, so that no edge is seen there.
        known_m = frame.depth * spec.depth_scale_m
        depth_m = np.where(valid, known_m, known_m.mean(where=valid))
        measured_m = self.noise.measured(depth_m, look)
        return _with_depth(frame, measured_m / spec.depth_scale_m, valid & (measured_m > 0))


@dataclass(frozen=True, slots=True, kw_only=True)
class PushedObject(Flaw):
    """An object does not stay where the method first saw it."""

    x_m: float
    """How far along the x axis of the base frame [m]."""
    y_m: float

    @classmethod
    def draw(cls, distance_m: float, rng: np.random.Generator) -> PushedObject:
        """In any direction."""
        x_m, y_m = _any_direction(distance_m, rng)
        return cls(x_m=x_m, y_m=y_m)

    @property
    def push_m(self) -> tuple[float, float]:
        """As drawn."""
        return self.x_m, self.y_m


def _any_direction(distance_m: float, rng: np.random.Generator) -> tuple[float, float]:
    """A vector of some length in the plane, uniform in its direction."""
    angle_rad = rng.uniform(0, 2 * math.pi)
    return distance_m * math.cos(angle_rad), distance_m * math.sin(angle_rad)


def _with_depth(frame: RgbdFrame, depth: NDArray[np.float64], valid: NDArray[np.bool_]) -> RgbdFrame:
    """The frame with other depth, in its own unit; what is valid stays so, whatever it is rounded to."""
    rounded = np.clip(np.rint(depth), 1, np.iinfo(frame.depth.dtype).max).astype(frame.depth.dtype)
    return replace(frame, depth=np.where(valid, rounded, 0).astype(frame.depth.dtype))
