"""Reading ``rig.toml``: everything that is wrong with it, in one message."""

from __future__ import annotations

import difflib
import ipaddress
import math
import re
import reprlib
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from itertools import product
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from handsight.collection.errors import RigSettingsError, UnreachableError
from handsight.collection.sim.grippers import FLANGE_TO_TIP_M
from handsight.collection.sim.kinematics import REFERENCE_RAD, joints_for
from handsight.collection.ur10.rig import CAMERAS, GENERATIONS, GRIPPERS, RigConfig
from handsight.datasets.format.typed import listed, shown
from handsight.servoing.planar import PlanarPose

_HOST = re.compile(r"(?=.{1,253}$)[A-Za-z0-9]([A-Za-z0-9-]*[A-Za-z0-9])?(\.[A-Za-z0-9]([A-Za-z0-9-]*[A-Za-z0-9])?)*")
_PORTS = range(1, 65536)
_LARGEST = 1e30
"""No quantity of a rig has a number beyond."""
_LONGEST_KEY = 60

# Least and greatest sensible values, units as in the name. What is beyond by a thousand was meant in another unit.
_RANGES: dict[str, tuple[float, float]] = {
    "robot.payload_kg": (0.0, 10.0),
    "robot.tcp_length_m": (0.0, 0.5),
    "robot.stale_s": (0.05, 5.0),
    "camera.nearest_m": (0.0, 2.0),
    "camera.farthest_m": (0.1, 10.0),
    "camera.least_valid": (0.0, 1.0),
    "camera.timeout_s": (0.1, 60.0),
    "camera.width": (64, 1920),
    "camera.height": (48, 1080),
    "camera.fps": (1, 90),
    "camera.exposure_us": (0, 165_000),
    "gripper.stroke_m": (0.005, 0.3),
    "gripper.closed_width_m": (0.0001, 0.05),
    "gripper.open_count": (0, 1200),
    "gripper.closed_count": (0, 1200),
    "gripper.margin_counts": (0, 50),
    "gripper.force": (0.0, 1.0),
    "gripper.speed": (0.0, 1.0),
    "gripper.pad_width_m": (0.001, 0.2),
    "gripper.pad_length_m": (0.001, 0.2),
    "gripper.timeout_s": (0.5, 60.0),
    "gripper.remeasure_every": (0, 1_000_000),
    "workspace.x_min_m": (-1.5, 1.5),
    "workspace.x_max_m": (-1.5, 1.5),
    "workspace.y_min_m": (-1.5, 1.5),
    "workspace.y_max_m": (-1.5, 1.5),
    "workspace.yaw_min_deg": (-175.0, 0.0),
    "workspace.yaw_max_deg": (0.0, 175.0),
    "workspace.table_height_m": (-1.5, 1.5),
    "workspace.clearance_m": (0.001, 0.1),
    "workspace.pregrasp_height_m": (0.02, 1.2),
    "workspace.overhead_height_m": (0.05, 1.2),
    "workspace.lift_height_m": (0.02, 1.2),
    "workspace.drop_height_m": (0.02, 1.2),
    "workspace.margin_m": (0.0, 0.3),
    "motion.speed_m_s": (0.01, 1.0),
    "motion.acceleration_m_s2": (0.05, 3.0),
    "motion.descend_speed_m_s": (0.005, 0.1),
    "motion.lift_speed_m_s": (0.01, 0.5),
    "motion.shake_speed_m_s": (0.01, 1.0),
    "motion.shake_m": (0.0, 0.1),
    "motion.shakes": (0, 10),
    "motion.contact_force_n": (5.0, 100.0),
    "motion.contact_samples": (1, 50),
    "motion.baseline_s": (0.02, 2.0),
    "motion.stop_acceleration_m_s2": (0.1, 10.0),
    "guards.joint_temperature_c": (30.0, 85.0),
    "guards.disk_free_gb": (0.0, 10_000.0),
    "guards.success_window": (0, 100_000),
    "guards.least_success": (0.0, 1.0),
    "guards.most_aborted": (0.0, 1.0),
    "guards.objects_height_m": (0.002, 0.2),
    "guards.empty_looks": (0, 1000),
    "recovery.protective_stops_per_10_min": (0, 100),
    "recovery.recoveries_per_hour": (0, 1000),
    "recovery.unlock_wait_s": (0.5, 60.0),
    "recovery.retreat_m": (0.0, 0.5),
    "recovery.retreat_speed_m_s": (0.005, 0.1),
    "board.columns": (3, 50),
    "board.rows": (3, 50),
    "board.square_m": (0.005, 0.2),
    "board.marker_m": (0.003, 0.2),
    "alarm.timeout_s": (0.5, 120.0),
}


def load_rig(path: Path) -> RigConfig:
    """Read a rig's file.

    Raises:
        RigSettingsError: It is missing, no TOML, or describes no usable rig; every fault is named.
    """
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RigSettingsError(
            f"{path} is missing, expected the rig's file: docs/rig.md has one to begin with"
        ) from None
    except (OSError, ValueError, RecursionError) as error:
        raise RigSettingsError(f"{path} cannot be read as TOML: {error}") from error
    return rig_from(values, path)


def rig_from(values: Mapping[str, Any], path: Path) -> RigConfig:
    """The rig of a parsed file; ``path`` is where files are relative to.

    Raises:
        RigSettingsError: Every fault is named.
    """
    faults: list[str] = []
    built = _table(RigConfig, values, "", faults, path.resolve().parent)
    if built is not None and not faults:
        faults += _relations(built)
        faults += _reach(built) if not faults else []
    if faults or built is None:
        raise RigSettingsError(f"{path} describes no usable rig: {listed(faults)}")
    rig: RigConfig = built
    return rig


def _table(kind: type, values: Mapping[str, Any], prefix: str, faults: list[str], folder: Path) -> Any:
    """One table as its dataclass; None where something of it is missing or wrong."""
    hints = get_type_hints(kind)
    known = {one.name: one for one in fields(kind)}
    before = len(faults)
    faults.extend(_unknown(prefix + name, list(known)) for name in values if name not in known)
    made: dict[str, Any] = {}
    for name, one in known.items():
        where = prefix + name
        if name not in values:
            if _required(one):
                faults.append(f"{where} is missing, expected {_expected(hints[name])}")
        elif is_dataclass(hints[name]):
            if not isinstance(values[name], Mapping):
                faults.append(f"{where} is {shown(values[name])}, expected a table [{where}]")
            else:
                made[name] = _table(hints[name], values[name], f"{where}.", faults, folder)
        else:
            made[name] = _value(values[name], hints[name], where, faults, folder)
    for name, one in known.items():
        if name not in values and not _required(one) and hints[name] is Path:
            made[name] = folder / str(one.default)
    return kind(**made) if len(faults) == before else None


def _required(one: Field[Any]) -> bool:
    return one.default is MISSING and one.default_factory is MISSING


def _unknown(where: str, known: list[str]) -> str:
    prefix, _, name = where.rpartition(".")
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    meant = f"{prefix}.{near[0]}" if prefix and near else near[0] if near else ""
    hint = f"did you mean {meant}?" if near else f"expected some of {', '.join(known)}"
    named = where if where.isprintable() and len(where) <= _LONGEST_KEY else shown(where)
    return f"{named} is no setting: {hint}"


def _expected(hint: Any) -> str:
    if is_dataclass(hint):
        return "a table"
    if get_origin(hint) is tuple:
        inner = get_args(hint)
        return "a list of words" if inner[0] is str else f"a list of {len(inner)} numbers"
    return {str: "a text", float: "a number", int: "a whole number", bool: "true or false", Path: "a path"}[hint]


def _value(value: Any, hint: Any, where: str, faults: list[str], folder: Path) -> Any:
    """One value, of the type that it should have; faults of type, range, address and unit are added."""
    if get_origin(hint) is tuple:
        inner = get_args(hint)
        length = None if inner[-1] is Ellipsis else len(inner)
        good = isinstance(value, list) and all(_is(one, inner[0]) for one in value)
        if not good or (length is not None and len(value) != length):
            faults.append(f"{where} is {reprlib.repr(value)}, expected {_expected(hint)}")
            return None
        if inner[0] is float and (largest := max(map(abs, value))) > 1.0:
            hinted = _unit_hint(largest, 1.0, where)
            faults.append(f"{where} is {reprlib.repr(value)}, expected metres within 1{hinted}")
        return tuple(inner[0](one) for one in value)
    if not _is(value, str if hint is Path else hint):
        faults.append(f"{where} is {shown(value)}, expected {_expected(hint)}")
        return None
    if hint is Path:
        return folder / value
    if where in _RANGES:
        least, most = _RANGES[where]
        if not least <= value <= most:
            hinted = _unit_hint(abs(value), max(abs(least), abs(most)), where)
            faults.append(f"{where} is {shown(value)}, expected {least:g} to {most:g}{hinted}")
    if where.endswith("address") and not _is_address(value):
        faults.append(f"{where} is {shown(value)}, expected an IP address or host name")
    if where.endswith("port") and value not in _PORTS and not (where == "gripper.port" and value == 0):
        faults.append(f"{where} is {shown(value)}, expected 1 to 65535")
    if where == "camera.file" and value:
        return str(folder / value)
    return hint(value)


def _is(value: object, hint: type) -> bool:
    if hint is bool or isinstance(value, bool):
        return hint is bool and isinstance(value, bool)
    if hint is float:
        return isinstance(value, int | float) and abs(value) <= _LARGEST
    return isinstance(value, hint)


def _unit_hint(size: float, most: float, where: str) -> str:
    if size > most and where.endswith(("_m", "_m_s", "_m_s2")):
        return ": was that in mm?"
    if size > most and where.endswith("_kg"):
        return ": was that in g?"
    if size > most and where.endswith("_s"):
        return ": was that in ms?"
    return ""


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
        return True
    except ValueError:
        # Four numbers with dots that are no address are a mistyped address and not a name.
        return not re.fullmatch(r"[0-9.]*", text) and _HOST.fullmatch(text) is not None


def _relations(rig: RigConfig) -> list[str]:
    """Values that are fine one by one and make no rig together."""
    faults = []
    for where, value, known in (
        ("robot.generation", rig.robot.generation, GENERATIONS),
        ("camera.kind", rig.camera.kind, CAMERAS),
        ("gripper.kind", rig.gripper.kind, GRIPPERS),
    ):
        if value not in known:
            near = difflib.get_close_matches(value, known, n=1)
            faults.append(
                f"{where} is {shown(value)}, expected {' or '.join(known)}" + (f": {near[0]}?" if near else "")
            )
    if rig.camera.kind == "emulated" and not rig.camera.address:
        faults.append("camera.address is missing, expected the address of the emulated camera")
    if rig.camera.kind == "recording" and not rig.camera.file:
        faults.append("camera.file is missing, expected a .db3 recording")
    area = rig.workspace
    for axis, low, high in (("x", area.x_min_m, area.x_max_m), ("y", area.y_min_m, area.y_max_m)):
        if not high - low >= 0.02:
            faults.append(f"workspace.{axis} runs from {low} to {high} m, expected an area at least 0.02 m wide")
    heights = (area.clearance_m, area.drop_height_m, area.pregrasp_height_m, area.overhead_height_m)
    if sorted(heights) != list(heights) or not area.clearance_m < area.lift_height_m <= area.overhead_height_m:
        faults.append(
            f"workspace heights are clearance {area.clearance_m}, drop {area.drop_height_m}, pre-grasp "
            f"{area.pregrasp_height_m}, lift {area.lift_height_m}, overhead {area.overhead_height_m} m, expected "
            "ascending, with the lift below the overhead pose"
        )
    if rig.gripper.open_count >= rig.gripper.closed_count and rig.gripper.kind == "robotiq":
        faults.append(
            f"gripper.open_count is {rig.gripper.open_count}, expected less than the closed_count "
            f"{rig.gripper.closed_count}"
        )
    if rig.gripper.closed_width_m >= rig.gripper.stroke_m:
        faults.append(f"gripper.closed_width_m is {rig.gripper.closed_width_m}, expected less than the stroke")
    if rig.camera.nearest_m >= rig.camera.farthest_m:
        faults.append(f"camera.nearest_m is {rig.camera.nearest_m}, expected less than farthest_m")
    return faults


def _reach(rig: RigConfig) -> list[str]:
    """Corners of the workspace that a UR10 cannot reach, at the heights at which it works."""
    area = rig.workspace
    corners = product(
        (area.x_min_m, area.x_max_m), (area.y_min_m, area.y_max_m), (area.clearance_m, area.pregrasp_height_m)
    )
    beyond = [
        f"({x_m:g}, {y_m:g}, {height_m:g})" for x_m, y_m, height_m in corners if not _reachable(rig, x_m, y_m, height_m)
    ]
    if not _reachable(rig, *area.centre_m, area.overhead_height_m):
        beyond.append("the overhead pose")
    if not beyond:
        return []
    return [f"the workspace has points that the UR10 cannot reach with the gripper down: {', '.join(beyond)} m"]


def _reachable(rig: RigConfig, x_m: float, y_m: float, height_m: float) -> bool:
    flange_shift_m = rig.robot.tcp_length_m - FLANGE_TO_TIP_M
    for yaw_rad in (math.radians(rig.workspace.yaw_min_deg), 0.0, math.radians(rig.workspace.yaw_max_deg)):
        pose = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=yaw_rad).pose_base_tool(
            height_m + rig.workspace.table_height_m + flange_shift_m
        )
        near = REFERENCE_RAD.copy()
        near[0] = math.atan2(-y_m, -x_m) % (2 * math.pi)
        try:
            joints_for(pose, near)
        except UnreachableError:
            return False
    return True
