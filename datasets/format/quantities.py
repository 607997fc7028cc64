"""Every number that an attempt, a station and a camera have: its unit, what it can be, and what it usually is.

What is impossible is refused when it is recorded or imported; what is unlikely is a warning of the doctor. Ranges of
the possible are so wide that no robot leaves them, because a refusal loses an attempt: they catch wrong units, not
wrong robots. A position 500 m away is therefore recorded, and the doctor calls it an error. Decision 015 has the
reasons.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Range = tuple[float, float]
"""Least and largest value, both included."""

_INT64_MAX = 2**63 - 1
_INT16_MAX = 2**15 - 1

_MISTAKEN: dict[str, tuple[tuple[float, str], ...]] = {
    "m": ((1e-3, "millimetres"), (1e-2, "centimetres")),
    "m per unit": ((1e-3, "millimetres per unit"),),
    "rad": ((math.pi / 180, "degrees"),),
    "s": ((1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds")),
    "ns": ((1e9, "seconds"), (1e6, "milliseconds"), (1e3, "microseconds")),
    "of 1": ((1e-2, "per cent"),),
}
"""By the right unit: what one of another unit is in it, and the name of that unit."""


_LEAST_SHARE = 1e-3
"""Of the largest likely value, below which no other unit is guessed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One kind of number."""

    name: str
    unit: str
    """Empty for counts."""
    possible: Range
    """Outside, it is refused when it is written."""
    likely: Range
    """Outside, the doctor warns."""
    source: str
    """Where the figures of ``likely`` come from."""
    inverse: str = ""
    """What a value may be that was given upside down; empty where nobody does that."""

    def fault(self, value: float, name: str = "") -> str | None:
        """Why a value is impossible, with the unit that it may be in; None where it is possible.

        Args:
            value: The number; NaN and infinity are impossible.
            name: What to call it; the name of the quantity by default.
        """
        if _within(value, self.possible):
            return None
        return self.complaint(value, self.possible, name)

    def complaint(self, value: float, expected: Range, name: str = "") -> str:
        """One line: what, the value, what was expected, and the unit that it may be in."""
        unit = f" {self.unit}" if self.unit else ""
        guess = self.mistaken_unit(value)
        question = f": {guess}?" if guess else ""
        low, high = ("2**63 - 1" if bound == _INT64_MAX else f"{bound:g}" for bound in expected)
        return f"{name or self.name} is {value}{unit}, expected {low} to {high}{unit}{question}"

    def mistaken_unit(self, value: float) -> str:
        """Units in which the value would be a likely one or, of an impossible value, a possible one; empty for none."""
        # Whole numbers of any length come from files, and no unit makes sense of one that is beyond all measure.
        if not -sys.float_info.max <= value <= sys.float_info.max:
            return ""
        read = [(value * factor, word) for factor, word in _MISTAKEN.get(self.unit, ())]
        if self.inverse and value:
            read.append((1 / value, self.inverse))
        for wanted in (self.likely, self.possible)[: 1 if _within(value, self.possible) else 2]:
            # Of several units that of a value far smaller than usual is nobody's: 3500 s are no nanoseconds.
            least = _LEAST_SHARE * max(map(abs, self.likely))
            words = [word for converted, word in read if abs(converted) >= least and _within(converted, wanted)]
            if words:
                return " or ".join(words)
        return ""

    def impossible(self, values: ArrayLike) -> NDArray[np.bool_]:
        """Which values are impossible. Those that are not known, NaN, are not."""
        return _outside(values, self.possible)

    def unlikely(self, values: ArrayLike) -> NDArray[np.bool_]:
        """Which values are possible and yet unlikely. Those that are not known, NaN, are not."""
        return _outside(values, self.likely) & ~self.impossible(values)


def _within(value: float, bounds: Range) -> bool:
    return bounds[0] <= value <= bounds[1]


def _outside(values: ArrayLike, bounds: Range) -> NDArray[np.bool_]:
    numbers = np.asarray(values)
    return np.asarray((numbers < bounds[0]) | (numbers > bounds[1]))


# The camera.

PICTURE_SIDE = Quantity(
    name="side of a picture",
    unit="px",
    possible=(1, 8192),
    likely=(32, 4096),
    source="D435: 424x240 to 1920x1080; depth cameras of industry up to 2448x2048",
)
"""The upper bound keeps an imported file from having memory set aside for whatever it claims."""

FIELD_OF_VIEW = Quantity(
    name="field of view",
    unit="rad",
    possible=(1e-3, 3.1),
    likely=(math.radians(10), math.radians(130)),
    source="D435: 69x42 degrees in colour, 87x58 in depth; Azure Kinect: up to 120x120",
)
"""What a focal length in pixels says about a picture of so many; one in millimetres gives almost half a turn."""

PRINCIPAL_POINT = Quantity(
    name="principal point",
    unit="px",
    possible=(-8192, 2 * 8192),
    likely=(0, 4096),
    source="a picture may be cut out of a larger one; GD-305 compares with the size of the picture",
)

CAMERA_OFFSET = Quantity(
    name="camera offset",
    unit="m",
    possible=(-5, 5),
    likely=(-0.5, 0.5),
    source="a camera clamped to the wrist; the paper's is 0.05 to 0.15 m from the fingertips",
)

DEPTH_SCALE = Quantity(
    name="depth_scale_m",
    unit="m per unit",
    possible=(1e-7, 0.5),
    likely=(1e-5, 2e-3),
    source="RealSense: 1 mm (D435), 0.25 mm (L515), 0.1 mm (D405); Kinect: 1 mm; TUM: 1/5000 m",
    inverse="units per metre",
)

DEPTH = Quantity(
    name="depth",
    unit="m",
    possible=(0, 65535 * 0.5),
    likely=(0.1, 10),
    source="D435: 0.175 m at 640x480 to 10 m",
)
"""Of most of a picture, as the median."""

# The gripper.

GRIPPER_STROKE = Quantity(
    name="gripper_stroke_m",
    unit="m",
    possible=(1e-3, 1),
    likely=(0.01, 0.35),
    source="Robotiq 2F-85: 85 mm, 2F-140: 140 mm; OnRobot RG2 and Schunk WSG-50: 110 mm; RG6: 160 mm",
)

CLOSED_WIDTH = Quantity(
    name="closed_width_m",
    unit="m",
    possible=(0, 1),
    likely=(0, 0.015),
    source="2F-85: 2 to 3 counts of 0.38 mm above its closed position; pads swell by millimetres",
)

JAW_OPENING = Quantity(
    name="jaw opening",
    unit="m",
    possible=(-0.1, 1),
    likely=(-0.01, 0.36),
    source="as the strokes above, with a zero that drifts; GD-202 compares with the session's own stroke",
)

# Where things are, in the base frame.

POSITION = Quantity(
    name="position",
    unit="m",
    possible=(-1e4, 1e4),
    likely=(-2, 2),
    source="reach of collaborative arms: UR10 1.3 m, UR20 1.75 m, CRX-25iA 1.89 m",
)

REACH = Quantity(
    name="distance from the base",
    unit="m",
    possible=(0, 5),
    likely=(0, 2.2),
    source="the longest reach of any arm sold is 4.7 m; collaborative arms as above, with a tool of 0.3 m",
)
"""Beyond ``possible`` it is an error of the doctor, not a refusal, and so it is for all that follows from poses: an
attempt must not be lost for a wrong calibration."""

REACH_OF_SOURCE_M = {"sim": 1.6, "ur10": 1.6}
"""Of the arms that are known: a UR10 reaches 1.3 m, and a gripper adds up to 0.3 m."""

OBJECT_DISTANCE = Quantity(
    name="distance of an object from the base",
    unit="m",
    possible=(0, 2e4),
    likely=(0, 5),
    source="as for the reach; objects roll off the table",
)

GRASP_HEIGHT = Quantity(
    name="height of the grasp",
    unit="m",
    possible=(-0.02, 5),
    likely=(-0.01, 1),
    source="fingertips stop 5 mm above the table; pads and calibration give way by millimetres",
)

CAMERA_HEIGHT = Quantity(
    name="height of the camera",
    unit="m",
    possible=(0, 10),
    likely=(0.1, 3),
    source="the paper: 0.5 m above the table; no arm lifts a camera higher than it reaches",
)

CAMERA_CLEARANCE = Quantity(
    name="height of the camera above the grasp",
    unit="m",
    possible=(0, 20),
    likely=(0.1, 3),
    source="what is grasped was seen from above",
)

PICTURES_AWAY = Quantity(
    name="distance from it",
    unit="pictures",
    possible=(0, 1),
    likely=(0, 0.5),
    source="inputs of the network are a third of a picture wide; 6 % of simulated grasps lie just outside",
)

PREGRASP_HEIGHT = Quantity(
    name="pregrasp_height_m",
    unit="m",
    possible=(1e-3, 5),
    likely=(0.05, 1.5),
    source="the paper: 0.4 m in simulation, 0.2 m on the rig",
)

ANGLE = Quantity(
    name="angle",
    unit="rad",
    possible=(-1e4, 1e4),
    likely=(-math.pi, math.pi),
    source="a grasp and its half turn are the same; larger angles were never wrapped (GD-204)",
)

OVERHEAD_ANGLE = Quantity(
    name="overhead_angle_rad",
    unit="rad",
    possible=(-4 * math.pi, 4 * math.pi),
    likely=(-math.pi, math.pi),
    source="two joints of a UR10 that turn the tool by up to 360 degrees each",
)
"""Of a table: a pose keeps no turns, so degrees would show nowhere once it is made."""

TOOL_TILT = Quantity(
    name="tilt of the tool from straight down",
    unit="rad",
    possible=(0, math.pi),
    likely=(0, math.radians(30)),
    source="planar grasps go straight down; a calibration is off by few degrees",
)

ROTATION_ERROR = Quantity(
    name="departure from orthonormality",
    unit="",
    possible=(0, 1e-4),
    likely=(0, 1e-4),
    source="rotations in single precision are within 1e-6",
)

QUATERNION_NORM = Quantity(
    name="length of an object's quaternion",
    unit="",
    possible=(0, math.inf),
    likely=(0.999, 1.001),
    source="a rotation has length 1",
)

GRASP_OFFSET = Quantity(
    name="distance of the grasp from the pose commanded",
    unit="m",
    possible=(0, math.inf),
    likely=(0, 0.05),
    source="arms repeat to 0.1 mm; contact pushes the fingers aside by millimetres",
)

# Forces, chances, counts.

CONTACT_FORCE = Quantity(
    name="contact_force_n",
    unit="N",
    possible=(-1e6, 1e6),
    likely=(-100, 2000),
    source="the paper stops at 40 N; simulated contacts reach 1500 N; a UR10 (CB3) errs by 10 N",
)

PROBABILITY = Quantity(name="predicted_success", unit="of 1", possible=(0, 1), likely=(0, 1), source="a probability")

SEED = Quantity(
    name="seed", unit="", possible=(0, _INT64_MAX), likely=(0, _INT64_MAX), source="signed integers of 64 bits"
)

OBJECTS_PER_SCENE = Quantity(
    name="objects_per_scene",
    unit="",
    possible=(0, 256),
    likely=(0, 100),
    source="the paper has up to 16 objects on the table",
)
"""It is the width of columns: the upper bound keeps a header from having gigabytes set aside."""

CATALOGUE = Quantity(
    name="number of objects",
    unit="",
    possible=(0, _INT16_MAX),
    likely=(0, _INT16_MAX),
    source="attempts name objects by integers of 16 bits; the paper has 1300 objects",
)

CONDITION_COUNT = Quantity(
    name="number of conditions", unit="", possible=(0, 1000), likely=(0, 100), source="as for objects_per_scene"
)

# Times.

PHASE = Quantity(
    name="duration of a phase",
    unit="s",
    possible=(0, 1e6),
    likely=(0, 600),
    source="phases take seconds; an arm that waits for its operator takes minutes",
)

STARTED = Quantity(
    name="started_ns",
    unit="ns",
    possible=(0, _INT64_MAX),
    likely=(946_684_800 * 10**9, 4_102_444_800 * 10**9),
    source="the years 2000 to 2099; a computer without a clock begins in 1970",
)
"""Since the epoch; 0 is not known."""

ELAPSED = Quantity(
    name="elapsed_ns",
    unit="ns",
    possible=(0, _INT64_MAX),
    likely=(10**5, 3600 * 10**9),
    source="an attempt takes seconds, of which a fast simulation takes milliseconds",
)
"""0 is not known."""
