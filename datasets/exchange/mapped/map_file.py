"""The map: a TOML file that says what the columns of a foreign set mean.

::

    [label]
    column = "next.success"             # HDF5: a dataset of the demo, or "@success" for an attribute of it
    frame = "last"                      # first, last, any, or a number; negative ones count from the end
    above = 0.5                         # held above this; or success = VALUE, held where it is equal

    [picture]                           # the one that the grasp is learnt from
    frame = "first"
    rgb = "observation.images.wrist"
    depth = "observation.images.wrist_depth"    # optional; without it every depth is 0, which is invalid
    depth_unit = "mm"                   # mm, m, or the metres of one unit

    [pose]                              # of the tool in the base frame
    column = "observation.state"
    convention = "xyz_rotvec"           # xyz_quat_wxyz, xyz_quat_xyzw, matrix, x_y_angle
    first = 0                           # where in the column it begins
    unit = "m"                          # m or mm
    grasp_frame = "last"                # frame in which the jaws closed: first, last, lowest, or a number
    z_m = 0.02                          # for x_y_angle: height of the tool in the grasp
    column_to_tool = [0, 0, 0, 0, 0, 0] # optional: see Transform; T is between the fingertips, x along the closing
    table_z_m = 0.0                     # height of the table top in the set's base frame

    [camera]
    fx = 600.0                          # [px], as are fy, cx and cy
    fy = 600.0
    cx = 319.5
    cy = 239.5
    pose_tool_camera = [0.0, -0.07, -0.11]      # on the gripper; or pose_base_camera, fixed
    largest_tilt_deg = 10.0             # of the camera, and of the tool in the grasp, from straight down

    [gripper]
    stroke_m = 0.085
    closed_width_m = 0.002
    pregrasp_height_m = 0.4

A transform is three numbers (x, y, z [m]), six (and a rotation vector [rad]), or four rows of four.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import InterchangeError, headline
from handsight.datasets.exchange.mapped.poses import CONVENTIONS, transform_of
from handsight.datasets.format.checks import Check, is_number, number, one_of, whole
from handsight.datasets.format.typed import shown
from handsight.datasets.machine import of_the_machine

Frame = str | int
"""``first``, ``last``, ``lowest``, ``any``, or a number; negative ones count from the end."""

_LARGEST_FILE = 1 << 20
_LAST_FRAME = (1 << 31) - 1
_MOST = 1e9
"""Of any number of a map."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspMap:
    """What the columns of a set mean. Transforms have shape (4, 4)."""

    label_column: str
    label_frame: Frame
    label_success: bool | int | float | str | None
    """The value of a held object; None where ``label_above`` decides."""
    label_above: float
    picture_frame: Frame
    rgb: str
    depth: str | None
    depth_unit_m: float
    """Metres in one unit of the set's depth."""
    pose_column: str
    pose_convention: str
    pose_first: int
    pose_unit_m: float
    grasp_frame: Frame
    grasp_z_m: float
    column_to_tool: NDArray[np.float64]
    table_z_m: float
    focal_and_centre_px: tuple[float, float, float, float]
    """fx, fy, cx, cy."""
    pose_tool_camera: NDArray[np.float64] | None
    """None where the camera is fixed."""
    pose_base_camera: NDArray[np.float64] | None
    largest_tilt_rad: float
    stroke_m: float
    closed_width_m: float
    pregrasp_height_m: float
    text: dict[str, Any]
    """The file as JSON values, for the header of the session."""


def read_map(path: Path) -> GraspMap:
    """Read a map.

    Raises:
        InterchangeError: It cannot be read or means nothing; the message lists every fault by its line.
    """
    text = _text_of(path)
    try:
        values = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InterchangeError(f"{path} is no TOML: {headline(error)}") from error
    faults = _faults(values, text)
    if faults:
        raise InterchangeError(f"{path} is no map: {'; '.join(faults)}")
    return _map_of(values)


def _text_of(path: Path) -> str:
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise InterchangeError(f"{path} has {path.stat().st_size} bytes, expected a map of some lines")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        if trouble := of_the_machine(f"{path} cannot be read", error):
            raise trouble from error
        raise InterchangeError(f"{path} cannot be read as a map: {headline(error)}") from error


def _map_of(values: Mapping[str, Mapping[str, Any]]) -> GraspMap:
    label, picture, pose, camera = (values[name] for name in ("label", "picture", "pose", "camera"))
    gripper = values["gripper"]
    units = {"mm": 1e-3, "m": 1.0}
    unit = picture.get("depth_unit", "mm")
    mounts = {name: transform_of(camera[name]) for name in ("pose_tool_camera", "pose_base_camera") if name in camera}
    return GraspMap(
        label_column=label["column"],
        label_frame=label.get("frame", "last"),
        label_success=label.get("success"),
        label_above=label.get("above", 0.5),
        picture_frame=picture.get("frame", "first"),
        rgb=picture["rgb"],
        depth=picture.get("depth"),
        depth_unit_m=units[unit] if isinstance(unit, str) else float(unit),
        pose_column=pose["column"],
        pose_convention=pose["convention"],
        pose_first=pose.get("first", 0),
        pose_unit_m=units[pose.get("unit", "m")],
        grasp_frame=pose.get("grasp_frame", "last"),
        grasp_z_m=float(pose.get("z_m", math.nan)),
        column_to_tool=transform_of(pose.get("column_to_tool", [0, 0, 0])),
        table_z_m=float(pose.get("table_z_m", 0)),
        focal_and_centre_px=tuple(float(camera[name]) for name in ("fx", "fy", "cx", "cy")),  # type: ignore[arg-type]
        pose_tool_camera=mounts.get("pose_tool_camera"),
        pose_base_camera=mounts.get("pose_base_camera"),
        largest_tilt_rad=math.radians(camera.get("largest_tilt_deg", 10)),
        stroke_m=float(gripper["stroke_m"]),
        closed_width_m=float(gripper.get("closed_width_m", 0.002)),
        pregrasp_height_m=float(gripper.get("pregrasp_height_m", 0.4)),
        text={table: dict(entries) for table, entries in values.items()},
    )


def _length(low: float, high: float) -> Check:
    """A length within a range; one a thousand times too large is taken for millimetres."""
    expected, meant = number(low, high, f"metres from {low:g} to {high:g}"), number(1000 * low, 1000 * high)

    def check(value: object) -> str | None:
        fault = expected(value)
        return fault if fault is None or meant(value) is not None else f"{fault}: millimetres?"

    return check


def _text(value: object) -> str | None:
    return None if isinstance(value, str) and value else "the name of a column"


def _frame(*words: str) -> Check:
    def check(value: object) -> str | None:
        fits = whole(-_LAST_FRAME, _LAST_FRAME)(value) is None or one_of(*words)(value) is None
        return None if fits else f"{', '.join(words)} or a number"

    return check


def _depth_unit(value: object) -> str | None:
    fits = value in ("mm", "m") or is_number(value, 1e-6, 1)
    return None if fits else "mm, m, or the metres of one unit"


def _scalar(value: object) -> str | None:
    return (
        None
        if isinstance(value, bool | str) or is_number(value, -_MOST, _MOST)
        else "a truth value, a number or a text"
    )


def _transform(value: object) -> str | None:
    try:
        pose = transform_of(value)
    except ValueError as error:
        return str(error)
    if np.abs(pose[:3, 3]).max() > 10:
        return "within 10 m: millimetres?"
    return None


_TABLES: dict[str, dict[str, tuple[bool, Check]]] = {
    "label": {
        "column": (True, _text),
        "frame": (False, _frame("first", "last", "any")),
        "success": (False, _scalar),
        "above": (False, number(-_MOST, _MOST, "a number")),
    },
    "picture": {
        "rgb": (True, _text),
        "frame": (False, _frame("first", "last")),
        "depth": (False, _text),
        "depth_unit": (False, _depth_unit),
    },
    "pose": {
        "column": (True, _text),
        "convention": (True, one_of(*CONVENTIONS)),
        "first": (False, whole(0, 4095, "a place from 0")),
        "unit": (False, one_of("m", "mm")),
        "grasp_frame": (False, _frame("first", "last", "lowest")),
        "z_m": (False, _length(-1, 3)),
        "column_to_tool": (False, _transform),
        "table_z_m": (False, _length(-3, 3)),
    },
    "camera": {
        **{name: (True, number(1, 1e5, "pixels, 1 to 100000")) for name in ("fx", "fy")},
        **{name: (True, number(-1e5, 1e5, "pixels")) for name in ("cx", "cy")},
        "pose_tool_camera": (False, _transform),
        "pose_base_camera": (False, _transform),
        "largest_tilt_deg": (False, number(0, 90, "degrees, 0 to 90")),
    },
    "gripper": {
        "stroke_m": (True, _length(0.005, 0.5)),
        "closed_width_m": (False, _length(0, 0.1)),
        "pregrasp_height_m": (False, _length(0.01, 2)),
    },
}


def _faults(values: Mapping[str, Any], text: str) -> list[str]:
    faults = [
        f"{_at(text, name)}[{name}] is unknown, expected {', '.join(_TABLES)}" for name in set(values) - set(_TABLES)
    ]
    for table, entries in _TABLES.items():
        given = values.get(table, {})
        if not isinstance(given, dict):
            faults.append(f"{_at(text, table)}{table} is {shown(given)}, expected a table [{table}]")
            continue
        for key, value in given.items():
            if key not in entries:
                faults.append(f"{_at(text, table, key)}[{table}] {key} is unknown, expected {', '.join(entries)}")
            elif expected := entries[key][1](value):
                faults.append(f"{_at(text, table, key)}[{table}] {key} is {shown(value)}, expected {expected}")
        missing = [key for key, (required, _) in entries.items() if required and key not in given]
        faults += [f"[{table}] lacks {', '.join(missing)}"] * bool(missing)
    return faults or _contradictions(values, text)


def _contradictions(values: Mapping[str, Mapping[str, Any]], text: str) -> list[str]:
    """What each value alone does not show."""
    faults = []
    label, camera, pose, gripper = (values[name] for name in ("label", "camera", "pose", "gripper"))
    if "success" in label and "above" in label:
        faults.append(f"{_at(text, 'label', 'above')}[label] has success and above, expected one of them")
    mounts = [name for name in ("pose_tool_camera", "pose_base_camera") if name in camera]
    if len(mounts) != 1:
        faults.append(
            f"[camera] has {' and '.join(mounts) or 'no pose'}, expected pose_tool_camera (on the gripper) or "
            "pose_base_camera (fixed)"
        )
    planar = pose["convention"] == "x_y_angle"
    if planar and "z_m" not in pose:
        faults.append("[pose] lacks z_m, the height of the tool in the grasp, which x_y_angle does not say")
    if planar and "pose_tool_camera" in camera:
        faults.append("[camera] is on the gripper, and x_y_angle does not say how high that was: give pose_base_camera")
    if planar and pose.get("grasp_frame") == "lowest":
        faults.append("[pose] grasp_frame is lowest, and x_y_angle says no height")
    if gripper.get("closed_width_m", 0.002) >= gripper["stroke_m"]:
        faults.append("[gripper] closed_width_m is not below stroke_m")
    return faults


def _at(text: str, table: str, key: str | None = None) -> str:
    """``line N: ``, where the entry can be found by looking."""
    inside = ""
    for place, line in enumerate(text.splitlines(), 1):
        stripped = line.strip()
        if stripped.startswith("["):
            inside = stripped.strip("[]# ").partition("]")[0]
            if key is None and inside == table:
                return f"line {place}: "
        name = stripped.partition("=")[0].strip().strip("\"'")
        if (inside == table and key is not None and name == key) or (not inside and key is None and name == table):
            return f"line {place}: "
    return ""
