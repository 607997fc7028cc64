"""Import of a folder of pictures and a table: what people have who did not record with handsight.

::

    FOLDER/station.json      the instruments: a station spec, see ``header.station_to_json``
    FOLDER/attempts.csv      one line for each attempt, with the columns below
    FOLDER/...               pictures: RGB of 8 bits and depth of 16 bits, as PNG or anything lossless OpenCV reads

Required columns

``overhead_rgb``, ``overhead_depth``
    Paths in the folder of the picture the grasp was chosen from.
``overhead_x_m``, ``overhead_y_m``, ``overhead_z_m``, ``overhead_angle_rad``
    Tool pose when it was taken, in the base frame; the tool points down.
``pregrasp_x_m``, ``pregrasp_y_m``, ``pregrasp_angle_rad``
    The pre-grasp pose commanded, in the base frame.
``grasp_z_m``
    Height of the tool when the jaws closed.
``width_final_m``
    Opening of the jaws after the lift. The attempt succeeded if it is above the station's ``closed_width_m``.

Optional columns: ``pregrasp_rgb`` and ``pregrasp_depth`` (the picture from there), ``target`` (an object of
the station's catalogue; where it lay is not known and recorded as the origin), ``contact_force_n``, ``started_ns``. Any
other column is refused, to catch typos.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from ulid import ULID

from handsight.datasets.errors import InterchangeError, RecordError
from handsight.datasets.exchange.bundle import Bundle
from handsight.datasets.exchange.sources import checked_source
from handsight.datasets.format.header import station_from_json
from handsight.datasets.format.sessions import new_session_attributes, sealed_attributes
from handsight.datasets.format.validation import header_faults
from handsight.datasets.records import (
    PHASES,
    GraspAttempt,
    GripperReadings,
    Outcome,
    RgbdFrame,
    SceneObjects,
    SessionHeader,
    StationSpec,
)
from handsight.datasets.writing.batches import prepare
from handsight.servoing.planar import PlanarPose

_TABLE, _STATION = "attempts.csv", "station.json"
_PATHS = ("overhead_rgb", "overhead_depth", "pregrasp_rgb", "pregrasp_depth")
_REQUIRED = (
    "overhead_rgb",
    "overhead_depth",
    "overhead_x_m",
    "overhead_y_m",
    "overhead_z_m",
    "overhead_angle_rad",
    "pregrasp_x_m",
    "pregrasp_y_m",
    "pregrasp_angle_rad",
    "grasp_z_m",
    "width_final_m",
)
_OPTIONAL = ("pregrasp_rgb", "pregrasp_depth", "target", "contact_force_n", "started_ns")
_FAULTS_SHOWN = 20

Line = dict[str, str]


def recognises(path: Path) -> bool:
    """Whether the path is a folder with a table of attempts."""
    return path.is_dir() and (path / _TABLE).is_file()


@contextmanager
def open_bundle(path: Path) -> Iterator[Bundle]:
    """Open a folder for import, as one session. Reads all of it once, so that every fault shows at once.

    Raises:
        InterchangeError: Something in it cannot be imported; the message lists every fault, by line of the table.
    """
    station = _station(path / _STATION)
    lines = _lines(path / _TABLE)
    header = SessionHeader(station=station, seed=None, objects_per_scene=1, config={"imported_from": path.name})
    faults = header_faults(header)
    digests = []
    for number, line in enumerate(lines):
        try:
            attempt = _attempt(path, line, number, station)
            prepared = prepare(attempt, header, session="of the table", number=number)
            digests.append(prepared.columns["attempts/digest"].tobytes())
        except (InterchangeError, RecordError) as error:
            faults.append(f"line {number + 2}: {error}")
    if faults:
        more = f"; and {len(faults) - _FAULTS_SHOWN} more" if len(faults) > _FAULTS_SHOWN else ""
        raise InterchangeError(f"{path} cannot be imported: {'; '.join(faults[:_FAULTS_SHOWN])}{more}")
    source = checked_source(
        str(ULID()),
        new_session_attributes(header) | sealed_attributes(),
        size=len(lines),
        attempts=lambda: (_attempt(path, line, number, station) for number, line in enumerate(lines)),
        digests=tuple(digests),
    )
    yield Bundle(sessions=[source])


def _station(path: Path) -> StationSpec:
    try:
        # The table has no columns for conditions that another station varied.
        return replace(station_from_json(json.loads(path.read_text())), conditions=())
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InterchangeError(
            f"{path} is no station spec ({type(error).__name__}: {error}), expected the JSON object that "
            "'handsight dataset show --json' prints as 'station'"
        ) from error


def _lines(path: Path) -> list[Line]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, strict=True)
            columns, lines = list(reader.fieldnames or ()), list(reader)
    except (OSError, ValueError, csv.Error) as error:
        raise InterchangeError(f"{path} cannot be read as a table: {error}") from error
    missing = [name for name in _REQUIRED if name not in columns]
    unknown = [name for name in columns if name not in (*_REQUIRED, *_OPTIONAL)]
    faults = [f"columns are missing: {', '.join(missing)}"] * bool(missing)
    faults += [f"columns are unknown: {', '.join(unknown)} (optional ones are {', '.join(_OPTIONAL)})"] * bool(unknown)
    faults += [f"line {at} has not {len(columns)} cells" for at, one in enumerate(lines, 2) if _ragged(one)]
    faults += ["there are no attempts"] * (not lines)
    if faults:
        raise InterchangeError(f"{path} cannot be imported: {'; '.join(faults)}")
    return lines


def _ragged(line: Line) -> bool:
    return None in line or None in line.values()


def _attempt(folder: Path, line: Line, number: int, station: StationSpec) -> GraspAttempt:
    values = {name: _number(line, name) for name in _REQUIRED if name not in _PATHS}
    x_m, y_m, angle_rad = values["pregrasp_x_m"], values["pregrasp_y_m"], values["pregrasp_angle_rad"]
    goal = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad)
    overhead = PlanarPose(
        x_m=values["overhead_x_m"], y_m=values["overhead_y_m"], angle_rad=values["overhead_angle_rad"]
    )
    final_m = values["width_final_m"]
    nan = float("nan")
    return GraspAttempt(
        number=number,
        outcome=Outcome.HELD if final_m > station.closed_width_m else Outcome.EMPTY,
        failure="",
        overhead=_frame(folder, line, "overhead", overhead.pose_base_tool(values["overhead_z_m"])),
        pregrasp=_pregrasp(folder, line, goal.pose_base_tool(station.pregrasp_height_m)),
        pregrasp_x_m=x_m,
        pregrasp_y_m=y_m,
        pregrasp_angle_rad=angle_rad,
        pose_base_tool_grasp=goal.pose_base_tool(values["grasp_z_m"]),
        contact_force_n=_number(line, "contact_force_n") if line.get("contact_force_n") else 0.0,
        gripper=GripperReadings(before_m=nan, closed_m=nan, lifted_m=nan, final_m=final_m),
        scene=_scene(line, station),
        truth_held=None,
        phase_s=np.full(len(PHASES), np.nan, np.float32),
        started_ns=_count(line, "started_ns"),
        elapsed_ns=0,
    )


def _pregrasp(folder: Path, line: Line, pose: NDArray[np.float64]) -> RgbdFrame | None:
    given = [bool(line.get(name)) for name in ("pregrasp_rgb", "pregrasp_depth")]
    if any(given) and not all(given):
        raise InterchangeError("pregrasp_rgb and pregrasp_depth belong together, and one of them is empty")
    return _frame(folder, line, "pregrasp", pose) if all(given) else None


def _frame(folder: Path, line: Line, viewpoint: str, pose: NDArray[np.float64]) -> RgbdFrame:
    colours = _picture(folder, line[f"{viewpoint}_rgb"])
    depth = _picture(folder, line[f"{viewpoint}_depth"])
    if colours.dtype != np.uint8 or colours.ndim != 3 or colours.shape[2] != 3:
        got = f"{colours.dtype} {colours.shape}"
        raise InterchangeError(f"{line[f'{viewpoint}_rgb']} is {got}, expected three 8-bit colours")
    if depth.dtype != np.uint16 or depth.ndim != 2:
        got = f"{depth.dtype} {depth.shape}"
        raise InterchangeError(f"{line[f'{viewpoint}_depth']} is {got}, expected one 16-bit channel")
    rgb = cv2.cvtColor(colours, cv2.COLOR_BGR2RGB)
    return RgbdFrame(rgb=rgb.astype(np.uint8), depth=depth.astype(np.uint16), pose_base_tool=pose)


def _picture(folder: Path, name: str) -> NDArray[Any]:
    """A picture inside the folder, with all its bits."""
    path = folder / name
    inside = folder.resolve()
    if not name or Path(name).is_absolute() or not path.resolve().is_relative_to(inside):
        raise InterchangeError(f"picture {name!r} is not in the folder, expected a relative path, no links")
    if not path.is_file() or not path.stat().st_size:
        raise InterchangeError(f"picture {name!r} does not exist or is empty")
    picture = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise InterchangeError(f"picture {name!r} cannot be decoded")
    return np.asarray(picture)


def _scene(line: Line, station: StationSpec) -> SceneObjects | None:
    target = line.get("target", "")
    if not target:
        return None
    if target not in station.objects:
        raise InterchangeError(f"target {target!r} is not among the objects of the station")
    index = np.array([station.objects.index(target)], np.int16)
    return SceneObjects(catalogue_index=index, pose_base_object=np.array([[0.0] * 6 + [1.0]]), target=0)


def _number(line: Line, name: str) -> float:
    try:
        return float(line[name])
    except ValueError as error:
        raise InterchangeError(f"{name} is {line[name]!r}, expected a number") from error


def _count(line: Line, name: str) -> int:
    try:
        return int(line.get(name) or 0)
    except ValueError as error:
        raise InterchangeError(f"{name} is {line[name]!r}, expected a whole number") from error
