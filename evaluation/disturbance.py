"""Stations that are not as their users believe: a camera that sits or looks askew, a worse one, objects that move.

A disturbance changes what the method is told, or what lies on the table once the method has made its first move, and
never how a trial begins: scenes and starting poses are those without. It answers whether closing the loop helps: a
method that looks again after every move can see that it has not arrived, one that looks once cannot.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from handsight.collection.collector import StationFactory
from handsight.collection.depth_noise import DepthNoise
from handsight.collection.station import Descent, Pushable, Station, Workspace
from handsight.datasets.records import RgbdFrame, SceneObjects, StationSpec
from handsight.evaluation.errors import EvaluationSettingsError
from handsight.evaluation.flaws import Flaw, NoisyDepth, PushedObject, ShiftedCamera, StereoDepth, TurnedCamera
from handsight.servoing.planar import PlanarPose

FIRST_MOVE: Final = 2
"""Of the poses that are reached in a trial the first is where it starts, the second where the first move leads."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Form:
    """One way in which a disturbance is written: a kind, and the unit of its size or the name of a model."""

    example: str
    largest: float
    """Largest size; 0 where it has none of its own."""
    draw: Callable[[float, np.random.Generator], Flaw]
    """The flaw of one trial, from the size as written and the trial's own stream."""


_FORMS: Final[dict[tuple[str, str], _Form]] = {
    ("hand-eye", "mm"): _Form(
        example="hand-eye:5mm", largest=100, draw=lambda size, rng: ShiftedCamera.draw(size / 1000, rng)
    ),
    ("hand-eye", "deg"): _Form(
        example="hand-eye:2deg", largest=20, draw=lambda size, rng: TurnedCamera.draw(math.radians(size), rng)
    ),
    ("moved", "mm"): _Form(
        example="moved:20mm", largest=100, draw=lambda size, rng: PushedObject.draw(size / 1000, rng)
    ),
    ("depth-noise", "mm"): _Form(
        example="depth-noise:4mm", largest=100, draw=lambda size, rng: NoisyDepth(deviation_m=size / 1000, rng=rng)
    ),
    ("depth-noise", "d435"): _Form(
        example="depth-noise:d435", largest=0, draw=lambda _, rng: StereoDepth(noise=DepthNoise.draw(rng))
    ),
}
EXAMPLES: Final = tuple(form.example for form in _FORMS.values())
"""Every way in which a disturbance is written."""
_WRITTEN: Final = re.compile(r"([a-z-]+):([0-9]{1,3}(?:\.[0-9]{1,3})?)?([a-z][a-z0-9]*)", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """One error, of the same size in every trial.

    ``hand-eye`` in mm: the camera is believed to sit beside where it is. In deg: it is turned about its centre, and
    believed to look straight down. ``depth-noise`` in mm: the standard deviation of every valid pixel of every depth
    picture. ``d435``: depth as that camera measures it. ``moved`` in mm: the object nearest to the gripper is pushed
    after the first move. Directions, axes and the quality of a camera are drawn for each trial.
    """

    kind: str
    """Its first word, as in ``EXAMPLES``."""
    unit: str
    """``mm`` or ``deg`` of the size, or the name of a model."""
    size: float
    """In that unit; 0 for a model, which has its own sizes."""

    @classmethod
    def parse(cls, text: str) -> Disturbance:
        """The disturbance that is written as one of ``EXAMPLES``, but for its size.

        Raises:
            EvaluationSettingsError: There is no such kind, or its size is out of range.
        """
        written = _WRITTEN.fullmatch(text.strip())
        form = None if written is None else _FORMS.get((written[1], written[3]))
        if written is None or form is None or (written[2] is None) != (form.largest == 0):
            raise EvaluationSettingsError(
                f"disturb is {text!r}, expected a kind and its size, written as {', '.join(EXAMPLES[:-1])} or "
                f"{EXAMPLES[-1]}"
            )
        size = float(written[2] or 0)
        if form.largest and not 0 < size <= form.largest:
            raise EvaluationSettingsError(
                f"disturb is {text!r}, expected a size of more than 0 and at most {form.largest:g} {written[3]}, such "
                f"as {form.example}"
            )
        return cls(kind=written[1], unit=written[3], size=size)

    @property
    def pushes(self) -> bool:
        """Whether a station has to push an object."""
        return self.kind == "moved"

    def draw(self, rng: np.random.Generator) -> Flaw:
        """What is wrong in the trial that this stream belongs to."""
        return _FORMS[self.kind, self.unit].draw(self.size, rng)

    def __str__(self) -> str:
        return f"{self.kind}:{f'{self.size:g}' if self.size else ''}{self.unit}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DisturbedFactory:
    """Opens disturbed stations in any process."""

    open_station: StationFactory
    disturbance: Disturbance

    def __post_init__(self) -> None:
        if self.disturbance.pushes and not self.open_station.pushable:
            raise _not_pushable(self.disturbance, self.open_station.spec)

    @property
    def spec(self) -> StationSpec:
        """The spec of every station before a trial disturbs it."""
        return self.open_station.spec

    @property
    def objects_per_scene(self) -> int:
        """Largest number of objects in a scene."""
        return self.open_station.objects_per_scene

    @property
    def pushable(self) -> bool:
        """Only the disturbance itself pushes."""
        return False

    def settings(self) -> dict[str, object]:
        """Those of the station, and the disturbance."""
        return {**self.open_station.settings(), "disturbance": str(self.disturbance)}

    def __call__(self) -> DisturbedStation:
        """Open a station."""
        return DisturbedStation(self.open_station(), self.disturbance)


class DisturbedStation:
    """A station that is not quite what it is said to be; its phases are those of the station behind it."""

    def __init__(self, station: Station, disturbance: Disturbance) -> None:
        """Take over a station.

        Raises:
            EvaluationSettingsError: Objects are to be pushed, and this station cannot.
        """
        self._station = station
        self._disturbance = disturbance
        self._pusher: Pushable | None = None
        if disturbance.pushes:
            if not isinstance(station, Pushable):
                raise _not_pushable(disturbance, station.spec)
            self._pusher = station
        self._spec = station.spec
        self._flaw = Flaw()
        self._looks = self._reached = 0

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
        """The scene that there is without disturbance; the flaw is drawn from a stream of its own afterwards."""
        scene = self._station.reset(rng)
        self._flaw = self._disturbance.draw(rng.spawn(1)[0])
        self._spec = self._flaw.believed(self._station.spec)
        self._looks = self._reached = 0
        return scene

    def look(self) -> RgbdFrame:
        """The picture as it is told."""
        frame = self._flaw.seen(self._station.look(), self._station.spec, self._looks)
        self._looks += 1
        return frame

    def reach(self, pose: PlanarPose) -> None:
        """Move to a pre-grasp pose; after the first servo move the object nearest to it may be pushed.

        Raises:
            PhaseError: The pose was not reached, or what was pushed does not come to rest.
        """
        self._station.reach(pose)
        self._reached += 1
        push_m = self._flaw.push_m
        if self._reached == FIRST_MOVE and self._pusher is not None and push_m is not None:
            self._pusher.push((pose.x_m, pose.y_m), push_m)

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


def _not_pushable(disturbance: Disturbance, spec: StationSpec) -> EvaluationSettingsError:
    return EvaluationSettingsError(
        f"disturb is {str(disturbance)!r}, which pushes an object, and the station {spec.source!r} cannot push any: "
        f"choose another station, or another disturbance, such as {EXAMPLES[0]}"
    )
