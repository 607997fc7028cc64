"""Import of a folder of pictures and a table: what people have who did not record with handsight.

::

    FOLDER/station.json      the instruments: a station spec, see ``header.station_to_json``
    FOLDER/attempts.csv      one line for each attempt, with the columns below
    FOLDER/...               pictures: RGB of 8 bits and depth of 16 bits, as PNG, TIFF or PNM

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
other column is refused, to catch typos. The table is UTF-8 with commas between cells; ``quantities.py`` has the ranges
within which a number can be true.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from ulid import ULID

from handsight.datasets.errors import HeaderError, InterchangeError, RecordError
from handsight.datasets.exchange.bundle import Bundle
from handsight.datasets.exchange.picture_files import read_colours, read_depth
from handsight.datasets.exchange.sources import checked_source
from handsight.datasets.exchange.spool import AttemptSpool
from handsight.datasets.exchange.table_lines import TableLine, read_lines
from handsight.datasets.format import quantities
from handsight.datasets.format.header import station_from_json
from handsight.datasets.format.quantities import Quantity
from handsight.datasets.format.sessions import new_session_attributes, sealed_attributes
from handsight.datasets.format.typed import listed, shown
from handsight.datasets.format.validation import header_faults
from handsight.datasets.machine import of_the_machine
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
_REQUIRED_NUMBERS = {
    "overhead_x_m": quantities.POSITION,
    "overhead_y_m": quantities.POSITION,
    "overhead_z_m": quantities.POSITION,
    "overhead_angle_rad": quantities.OVERHEAD_ANGLE,
    "pregrasp_x_m": quantities.POSITION,
    "pregrasp_y_m": quantities.POSITION,
    "pregrasp_angle_rad": quantities.ANGLE,
    "grasp_z_m": quantities.POSITION,
    "width_final_m": quantities.JAW_OPENING,
}
_REQUIRED = ("overhead_rgb", "overhead_depth", *_REQUIRED_NUMBERS)
_OPTIONAL = ("pregrasp_rgb", "pregrasp_depth", "target", "contact_force_n", "started_ns")
_MOST_STATION_BYTES = 2**24
_STROKE_SLACK_M = 0.01
"""How far a gripper may be open beyond its stroke; the doctor warns far earlier."""

T = TypeVar("T")


def recognises(path: Path) -> bool:
    """Whether the path is a folder with a table of attempts."""
    return path.is_dir() and (path / _TABLE).is_file()


@contextmanager
def open_bundle(path: Path) -> Iterator[Bundle]:
    """Open a folder for import, as one session. Reads all of it, once, so that every fault shows at once.

    Raises:
        InterchangeError: Something in it cannot be imported; the message lists faults by line of the table.
    """
    station, lines = _station_and_lines(path)
    header = SessionHeader(station=station, seed=None, objects_per_scene=1, config={"imported_from": path.name})
    faults = header_faults(header)
    if faults:
        raise InterchangeError(f"{path / _STATION} cannot be imported: {listed(faults)}")
    digests = []
    with AttemptSpool(header) as spool:
        for number, line in enumerate(lines):
            try:
                prepared = prepare(_attempt(path, line, number, station), header, session="of the table", number=number)
                digests.append(prepared.columns["attempts/digest"].tobytes())
            except _LineError as error:
                faults += [f"line {line.number}: {fault}" for fault in error.faults]
            except RecordError as error:
                faults.append(f"line {line.number}: {error}")
            else:
                if not faults:  # Else nothing will be imported.
                    spool.append(prepared)
        if faults:
            raise InterchangeError(f"{path} cannot be imported: {listed(faults)}")
        source = checked_source(
            str(ULID()),
            new_session_attributes(header) | sealed_attributes(),
            size=len(lines),
            attempts=lambda: (_attempt(path, line, number, station) for number, line in enumerate(lines)),
            digests=tuple(digests),
        )
        yield Bundle(sessions=[replace(source, encoded=spool.attempts)])


def _station_and_lines(path: Path) -> tuple[StationSpec, list[TableLine]]:
    """Both files; the faults of both where either cannot be read."""
    faults = []
    try:
        station = _station(path / _STATION)
    except InterchangeError as error:
        faults.append(str(error))
    try:
        lines = read_lines(path / _TABLE, required=_REQUIRED, optional=_OPTIONAL)
    except InterchangeError as error:
        faults.append(str(error))
    if faults:
        raise InterchangeError("; ".join(faults))
    return station, lines


def _station(path: Path) -> StationSpec:
    try:
        if path.is_file() and path.stat().st_size > _MOST_STATION_BYTES:
            raise HeaderError(f"it takes {path.stat().st_size} bytes, expected at most {_MOST_STATION_BYTES}")
        values = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=_fields)
        # The table has no columns for conditions that another station varied.
        return replace(station_from_json(values), conditions=())
    except (OSError, ValueError, RecursionError) as error:
        if trouble := of_the_machine(f"{path} cannot be read", error):
            raise trouble from error
        reason = error.strerror if isinstance(error, OSError) else error
        raise InterchangeError(
            f"{path} is no station spec: {reason}; expected the JSON object that stands at 'station' where "
            "an attempt is shown with --json"
        ) from error


def _fields(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The fields of a JSON object, each given once."""
    values = dict(pairs)
    if len(values) < len(pairs):
        names = [name for name, _ in pairs]
        twice = [name for name in values if names.count(name) > 1]
        raise HeaderError(f"{', '.join(map(shown, twice))} is given more than once")
    return values


class _LineError(Exception):
    """A line of the table from which no attempt can be made."""

    def __init__(self, faults: list[str]) -> None:
        super().__init__("; ".join(faults))
        self.faults = faults


class _Cells:
    """The cells of one line, read one by one; what is wrong with any is kept until all have been looked at."""

    def __init__(self, line: TableLine) -> None:
        self._cells = line.cells
        self.faults: list[str] = []

    def text(self, name: str) -> str:
        return self._cells.get(name, "").strip()

    def number(self, name: str, quantity: Quantity) -> float:
        text = self.text(name)
        try:
            # Python alone takes "1_000" for a number.
            value = math.nan if "_" in text else float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self.faults.append(f"{name} is {shown(text)}, expected a number, with a point for its fraction")
            return math.nan
        fault = quantity.fault(value, name)
        self.faults += [fault] if fault else []
        return value

    def moment_ns(self, name: str) -> int:
        text = self.text(name)
        if not text.isascii() or not text.isdigit() or len(text) > 19:
            if text:
                self.faults.append(
                    f"{name} is {shown(text)}, expected a whole number of nanoseconds since 1970, or none"
                )
            return 0
        value = int(text)
        if value and not quantities.STARTED.likely[0] <= value <= quantities.STARTED.likely[1]:
            # A table is written when the times are known: no clock is to be excused here.
            self.faults.append(quantities.STARTED.complaint(value, quantities.STARTED.likely, name))
        return value

    def attempted(self, make: Callable[[], T]) -> T | None:
        """What a call makes; its refusal is a fault of the line."""
        try:
            return make()
        except InterchangeError as error:
            self.faults.append(str(error))
            return None


def _attempt(folder: Path, line: TableLine, number: int, station: StationSpec) -> GraspAttempt:
    cells = _Cells(line)
    values = {name: cells.number(name, quantity) for name, quantity in _REQUIRED_NUMBERS.items()}
    x_m, y_m, angle_rad = (values[f"pregrasp_{name}"] for name in ("x_m", "y_m", "angle_rad"))
    goal = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad)
    overhead = PlanarPose(**{name: values[f"overhead_{name}"] for name in ("x_m", "y_m", "angle_rad")})
    final_m = values["width_final_m"]
    cells.faults += _stroke_faults(final_m, station)
    nan = float("nan")
    attempt = GraspAttempt(
        number=number,
        outcome=Outcome.HELD if final_m > station.closed_width_m else Outcome.EMPTY,
        failure="",
        overhead=_frame(folder, cells, "overhead", overhead.pose_base_tool(values["overhead_z_m"]), station),
        pregrasp=_pregrasp(folder, cells, goal.pose_base_tool(station.pregrasp_height_m), station),
        pregrasp_x_m=x_m,
        pregrasp_y_m=y_m,
        pregrasp_angle_rad=angle_rad,
        pose_base_tool_grasp=goal.pose_base_tool(values["grasp_z_m"]),
        contact_force_n=_optional_force(cells),
        gripper=GripperReadings(before_m=nan, closed_m=nan, lifted_m=nan, final_m=final_m),
        scene=cells.attempted(lambda: _scene(cells.text("target"), station)),
        truth_held=None,
        phase_s=np.full(len(PHASES), np.nan, np.float32),
        started_ns=cells.moment_ns("started_ns"),
        elapsed_ns=0,
    )
    if cells.faults:
        raise _LineError(cells.faults)
    return attempt


def _stroke_faults(final_m: float, station: StationSpec) -> list[str]:
    widest_m = station.gripper_stroke_m + _STROKE_SLACK_M
    if quantities.JAW_OPENING.impossible(final_m) or not final_m > widest_m:
        return []
    return [quantities.JAW_OPENING.complaint(final_m, (0, station.gripper_stroke_m), "width_final_m")]


def _optional_force(cells: _Cells) -> float:
    return cells.number("contact_force_n", quantities.CONTACT_FORCE) if cells.text("contact_force_n") else 0.0


def _pregrasp(folder: Path, cells: _Cells, pose: NDArray[np.float64], station: StationSpec) -> RgbdFrame | None:
    given = [bool(cells.text(name)) for name in ("pregrasp_rgb", "pregrasp_depth")]
    if any(given) and not all(given):
        cells.faults.append("pregrasp_rgb and pregrasp_depth belong together, and one of them is empty")
    return _frame(folder, cells, "pregrasp", pose, station) if all(given) else None


def _frame(
    folder: Path, cells: _Cells, viewpoint: str, pose: NDArray[np.float64], station: StationSpec
) -> RgbdFrame | None:
    size = (station.camera.intrinsics.height, station.camera.intrinsics.width)
    rgb = cells.attempted(lambda: read_colours(folder, cells.text(f"{viewpoint}_rgb"), size))
    depth = cells.attempted(lambda: read_depth(folder, cells.text(f"{viewpoint}_depth"), size))
    return None if rgb is None or depth is None else RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=pose)


def _scene(target: str, station: StationSpec) -> SceneObjects | None:
    if not target:
        return None
    if target not in station.objects:
        raise InterchangeError(f"target {shown(target)} is not among the objects of the station")
    index = np.array([station.objects.index(target)], np.int16)
    return SceneObjects(catalogue_index=index, pose_base_object=np.array([[0.0] * 6 + [1.0]]), target=0)
