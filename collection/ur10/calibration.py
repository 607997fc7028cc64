"""What was measured of a rig, kept in one file: hand-eye, table, jaws, payload and reach, with id, dates and residuals.

Every attempt carries it, through the configuration of its session; a rig with another camera or arm than the one that
was measured does not move.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import RigSettingsError
from handsight.collection.ur10.logs import now
from handsight.datasets.atomic import write_text
from handsight.datasets.errors import HeaderError
from handsight.datasets.format.typed import listed, shown, typed
from handsight.servoing.camera import HandCamera, Intrinsics

MOST_TURN_RAD = 0.26
"""A camera that is turned further against the tool is mounted in another way than we think."""
_REMEDY = "calibrate anew with 'rig calibrate'"
_RANGES = {
    "camera.depth_scale_m": (1e-6, 0.1),
    "camera.translation_m": (-1.0, 1.0),
    "camera.rotation_rad": (-7.0, 7.0),
    "camera.residual_m": (0.0, 1.0),
    "camera.residual_rad": (0.0, 7.0),
    "camera.views": (0, 10_000),
    "table.height_m": (-2.0, 2.0),
    "table.tilt_rad": (0.0, 1.6),
    "table.residual_m": (0.0, 1.0),
    "table.points": (0, 10_000),
    "jaws.open_count": (0, 65_535),
    "jaws.closed_count": (0, 65_535),
    "jaws.spread": (0, 65_535),
    "jaws.pad_width_m": (0.0, 0.5),
    "jaws.pad_length_m": (0.0, 0.5),
    "payload.mass_kg": (0.0, 20.0),
    "payload.centre_of_mass_m": (-1.0, 1.0),
    "payload.told_kg": (0.0, 20.0),
    "payload.residual_n": (0.0, 1000.0),
    "payload.residual_nm": (0.0, 1000.0),
    "payload.poses": (0, 10_000),
    "reach.x_min_m": (-2.0, 2.0),
    "reach.y_min_m": (-2.0, 2.0),
    "reach.step_m": (0.001, 1.0),
}
"""What a rig can have; NaN is in none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraCalibration:
    """Where the camera sits in the tool frame."""

    date: str
    serial: str
    intrinsics: Intrinsics
    depth_scale_m: float
    translation_m: tuple[float, float, float]
    """Camera centre in the tool frame."""
    rotation_rad: tuple[float, float, float]
    """Rotation vector that maps camera axes to tool axes."""
    residual_m: float
    residual_rad: float
    """RMS spread of the board's pose in the base frame, over the views."""
    views: int
    robot: str = ""
    """Serial number of the arm that moved."""

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Camera axes in the tool frame. Shape (3, 3)."""
        return np.asarray(cv2.Rodrigues(np.asarray(self.rotation_rad, dtype=np.float64))[0], dtype=np.float64)

    @property
    def camera(self) -> HandCamera:
        """The camera of rectified pictures: at the same place, its axes parallel to the tool's."""
        x_m, y_m, z_m = self.translation_m
        return HandCamera(intrinsics=self.intrinsics, x_tool_camera_m=x_m, y_tool_camera_m=y_m, z_tool_camera_m=z_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class TableCalibration:
    """The table top, touched at several points."""

    date: str
    height_m: float
    """In the controller's base frame, in the middle of the workspace."""
    tilt_rad: float
    residual_m: float
    points: int


@dataclass(frozen=True, slots=True, kw_only=True)
class JawCalibration:
    """Raw readings of the empty jaws."""

    date: str
    open_count: int
    closed_count: int
    spread: int
    """Difference between the readings of the closed jaws."""
    pad_width_m: float
    pad_length_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PayloadCalibration:
    """What hangs on the flange, weighed by the arm."""

    date: str
    mass_kg: float
    centre_of_mass_m: tuple[float, float, float]
    """In the flange frame."""
    told_kg: float
    """What the controller was told while it was weighed."""
    residual_n: float
    residual_nm: float
    poses: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachCalibration:
    """Which part of the workspace arm and controller allow."""

    date: str
    x_min_m: float
    y_min_m: float
    step_m: float
    rows: tuple[str, ...]
    """One for each cell along x, a character for each along y: ``#`` is reached, ``.`` is not."""

    def __post_init__(self) -> None:
        if not self.rows or len({len(row) for row in self.rows}) != 1 or set("".join(self.rows)) - set("#."):
            raise ValueError("the rows are of no map")

    @property
    def share(self) -> float:
        """Of the cells that are reached."""
        return sum(row.count("#") for row in self.rows) / sum(map(len, self.rows))


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Everything that was measured so far."""

    camera: CameraCalibration | None = None
    table: TableCalibration | None = None
    jaws: JawCalibration | None = None
    payload: PayloadCalibration | None = None
    reach: ReachCalibration | None = None

    @property
    def id(self) -> str:
        """Of these values: twelve hexadecimal digits."""
        measured = {name: value for name, value in asdict(self).items() if value is not None}
        return hashlib.sha256(json.dumps(measured, sort_keys=True).encode()).hexdigest()[:12]

    def to_json(self) -> dict[str, Any]:
        """All of it as JSON values, with its id."""
        return {"id": self.id, **{name: value for name, value in asdict(self).items() if value is not None}}


def load_calibration(path: Path) -> Calibration:
    """Read a file; one that is not there is a rig of which nothing was measured.

    Raises:
        RigSettingsError: The file is damaged, was changed by hand, or is none of ours; every fault is named.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return Calibration()
    except (OSError, ValueError, RecursionError) as error:
        raise RigSettingsError(f"calibration {path} cannot be read: {error}") from error
    told = values.pop("id", None) if isinstance(values, dict) else None
    try:
        found = typed(Calibration, values)
    except HeaderError as error:
        raise RigSettingsError(f"calibration {path} is damaged ({error}): {_REMEDY}") from error
    faults = list(_out_of_range(found))
    if told is not None and told != found.id:
        faults.append(f"id is {shown(told)}, expected {found.id} of these values, or none where you changed them")
    if faults:
        raise RigSettingsError(f"calibration {path} is damaged ({listed(faults)}): {_REMEDY}")
    return found


def _out_of_range(calibration: Calibration) -> Iterator[str]:
    values = asdict(calibration)
    for name, (low, high) in _RANGES.items():
        part, field = name.split(".")
        if values[part] is None:
            continue
        given = values[part][field]
        for one in given if isinstance(given, tuple) else (given,):
            if not low <= one <= high:
                yield f"{name} is {shown(one)}, expected {low:g} to {high:g}"


def save_calibration(path: Path, calibration: Calibration) -> None:
    """Write a file, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, json.dumps(calibration.to_json(), indent=2) + "\n")


def check_calibration(calibration: Calibration, path: Path, serial: str) -> CameraCalibration:
    """The camera's part, for the camera of this serial number.

    Args:
        calibration: What was read.
        path: Where from.
        serial: As rig.toml or the camera itself has it; empty asks for none.

    Raises:
        RigSettingsError: It is missing, or one of another camera, or of none that could be mounted so.
    """
    found = calibration.camera
    if found is None:
        raise RigSettingsError(f"{path} has no camera calibration: run 'rig calibrate camera' first")
    faults = []
    if serial and found.serial != serial:
        faults.append(f"it is of the camera {found.serial}, and the rig has {serial}")
    turn_rad = float(np.linalg.norm(found.rotation_rad))
    if turn_rad > MOST_TURN_RAD:
        faults.append(f"the camera is turned by {turn_rad:.2f} rad against the tool, expected at most {MOST_TURN_RAD}")
    if faults:
        raise RigSettingsError(f"calibration {path}: {'; '.join(faults)}; run 'rig calibrate camera'")
    return found


def with_part(calibration: Calibration, **part: Any) -> Calibration:
    """A calibration with one part measured anew."""
    return replace(calibration, **part)


def today() -> str:
    """The date that a measurement carries."""
    return now()
