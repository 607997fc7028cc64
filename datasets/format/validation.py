"""What a record must satisfy before it is stored. Every check adds to one list, so that all faults show at once."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import counted
from handsight.datasets.format import quantities
from handsight.datasets.format.attempts_table import TABLE
from handsight.datasets.format.header import canonical_json
from handsight.datasets.format.quantities import Quantity
from handsight.datasets.format.rows import frame_of
from handsight.datasets.format.schema import FAILURE_BYTES, VIEWPOINTS
from handsight.datasets.format.typed import shown
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
from handsight.servoing.camera import HandCamera, Intrinsics

_LONGEST_NAME = 512
"""Characters of an object's name, a condition's or a serial number."""


def header_faults(header: SessionHeader) -> list[str]:
    """What keeps a session with this header from being recorded; empty when nothing does.

    The fields have the types that they are declared with (``typed.py`` sees to that for what comes from elsewhere).
    """
    faults = station_faults(header.station)
    if header.seed is not None:
        faults += _number_faults([(quantities.SEED, header.seed, "seed")])
    faults += _number_faults([(quantities.OBJECTS_PER_SCENE, header.objects_per_scene, "objects_per_scene")])
    return faults + json_faults("config", header.config)


def station_faults(station: StationSpec) -> list[str]:
    """What keeps a station from being recorded; empty when nothing does."""
    faults = []
    if not re.fullmatch(r"[a-z][a-z0-9_-]*", station.source) or len(station.source) > _LONGEST_NAME:
        faults.append(f"source is {shown(station.source)}, expected a lower-case word such as sim or ur10")
    faults += _number_faults(
        [
            (quantities.DEPTH_SCALE, station.depth_scale_m, "depth_scale_m"),
            (quantities.PREGRASP_HEIGHT, station.pregrasp_height_m, "pregrasp_height_m"),
            (quantities.GRIPPER_STROKE, station.gripper_stroke_m, "gripper_stroke_m"),
            (quantities.CLOSED_WIDTH, station.closed_width_m, "closed_width_m"),
        ]
    )
    if station.closed_width_m >= station.gripper_stroke_m:
        faults.append(
            f"closed_width_m is {station.closed_width_m} and gripper_stroke_m {station.gripper_stroke_m}, "
            "expected 0 <= closed < stroke"
        )
    faults += camera_faults(station.camera)
    return faults + _catalogue_faults(station) + _condition_name_faults(station.conditions)


def camera_faults(camera: HandCamera) -> list[str]:
    """What keeps a camera from being recorded; empty when nothing does."""
    lens = camera.intrinsics
    offsets = [(quantities.CAMERA_OFFSET, getattr(camera, f"{axis}_tool_camera_m"), axis) for axis in "xyz"]
    faults = _number_faults(
        [
            (quantities.PICTURE_SIDE, lens.width, "camera.intrinsics.width"),
            (quantities.PICTURE_SIDE, lens.height, "camera.intrinsics.height"),
            (quantities.PRINCIPAL_POINT, lens.cx, "camera.intrinsics.cx"),
            (quantities.PRINCIPAL_POINT, lens.cy, "camera.intrinsics.cy"),
            *((quantity, value, f"camera.{axis}_tool_camera_m") for quantity, value, axis in offsets),
        ]
    )
    for side, focal, name in ((lens.width, lens.fx, "fx"), (lens.height, lens.fy, "fy")):
        angle = field_of_view_rad(side, focal)
        if not quantities.PICTURE_SIDE.impossible(side) and quantities.FIELD_OF_VIEW.impossible(angle):
            low, high = quantities.FIELD_OF_VIEW.possible
            faults.append(
                f"camera.intrinsics.{name} is {focal:g} px for {side} px, a field of view of {angle:.4g} rad, expected "
                f"{low:g} to {high:g} rad: focal lengths are in pixels"
            )
    return faults


def field_of_view_rad(side_px: int, focal_px: float) -> float:
    """The angle that a picture spans along one of its sides [rad]."""
    return 2 * math.atan2(side_px, 2 * focal_px)


def json_faults(name: str, value: object) -> list[str]:
    """What keeps a value from being stored as JSON; empty when nothing does."""
    try:
        canonical_json(value)
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        return [f"{name} holds a lone surrogate, expected text that UTF-8 can write"]
    except (TypeError, ValueError, RecursionError) as error:
        return [f"{name} is not JSON: {error}"]
    return []


def attempt_faults(attempt: GraspAttempt, header: SessionHeader) -> list[str]:
    """What keeps an attempt from being recorded in a session with this header; empty when nothing does."""
    intrinsics = header.station.camera.intrinsics
    faults = []
    for viewpoint in VIEWPOINTS:
        frame = frame_of(attempt, viewpoint)
        if frame is not None:
            faults += _frame_faults(viewpoint, frame, intrinsics)
    faults += _motion_faults(attempt)
    faults += _gripper_faults(attempt.gripper)
    faults += _scene_faults(attempt.scene, header)
    faults += _outcome_faults(attempt, header.station)
    clock = [
        (quantities.STARTED, attempt.started_ns, "started_ns"),
        (quantities.ELAPSED, attempt.elapsed_ns, "elapsed_ns"),
    ]
    return faults + _number_faults(clock)


def _number_faults(numbers: Iterable[tuple[Quantity, float, str]]) -> list[str]:
    """The complaints about numbers that are impossible, each under its name."""
    faults = [quantity.fault(value, name) for quantity, value, name in numbers]
    return [fault for fault in faults if fault is not None]


def _catalogue_faults(station: StationSpec) -> list[str]:
    serials = station.serials or {}
    texts = {
        "objects": station.objects,
        "conditions": station.conditions,
        "serials": (*serials, *serials.values()),
    }
    faults = _number_faults(
        [
            (quantities.CATALOGUE, len(station.objects), "the number of objects"),
            (quantities.CONDITION_COUNT, len(station.conditions), "the number of conditions"),
        ]
    )
    for kind, names in texts.items():
        strange = [name for name in names if not _is_plain(name)]
        if strange:
            faults.append(
                f"{kind} holds {', '.join(map(shown, strange[:3]))}, expected text of up to {_LONGEST_NAME} "
                "characters without control characters"
            )
    if "" in station.objects:
        faults.append("objects holds an empty name")
    for kind in ("objects", "conditions"):
        twice = [name for name, number in Counter(texts[kind]).items() if number > 1]
        if twice:
            faults.append(f"{kind} names {', '.join(map(str, sorted(twice)[:3]))} more than once")
    return faults


def _is_plain(text: str) -> bool:
    """Whether UTF-8 can write a text, and a terminal show it on one line."""
    broken = any(one < " " or one == "\x7f" or "\ud800" <= one <= "\udfff" for one in text)
    return not broken and len(text) <= _LONGEST_NAME


def _condition_name_faults(conditions: tuple[str, ...]) -> list[str]:
    strange = [name for name in conditions if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or name in TABLE]
    if not strange:
        return []
    return [
        f"conditions names {', '.join(map(shown, strange[:3]))}, expected words such as table_friction that are no "
        "columns of the attempts table already"
    ]


def _frame_faults(name: str, frame: RgbdFrame, intrinsics: Intrinsics) -> list[str]:
    size = (intrinsics.height, intrinsics.width)
    return [
        *_array_faults(f"{name}.rgb", frame.rgb, np.uint8, (*size, 3)),
        *_array_faults(f"{name}.depth", frame.depth, np.uint16, size),
        *_pose_faults(f"{name}.pose_base_tool", frame.pose_base_tool),
    ]


def _motion_faults(attempt: GraspAttempt) -> list[str]:
    faults = []
    commanded = attempt.labelled or attempt.pregrasp is not None
    for name in ("pregrasp_x_m", "pregrasp_y_m", "pregrasp_angle_rad"):
        value = getattr(attempt, name)
        if not math.isfinite(value) and (commanded or not math.isnan(value)):
            faults.append(f"{name} is {value}, expected finite (NaN only where the attempt ended before the pre-grasp)")
        elif math.isfinite(value):
            quantity = quantities.ANGLE if name.endswith("_rad") else quantities.POSITION
            faults += _number_faults([(quantity, value, name)])
    if not math.isnan(attempt.predicted_success):
        faults += _number_faults([(quantities.PROBABILITY, attempt.predicted_success, "predicted_success")])
    faults += _number_faults([(quantities.CONTACT_FORCE, attempt.contact_force_n, "contact_force_n")])
    pose = attempt.pose_base_tool_grasp
    faults += _pose_faults("pose_base_tool_grasp", pose, optional=not attempt.labelled)
    phase_faults = _array_faults("phase_s", attempt.phase_s, np.float32, (len(PHASES),))
    if not phase_faults:
        strange = [
            (at, float(attempt.phase_s[at])) for at in np.flatnonzero(quantities.PHASE.impossible(attempt.phase_s))
        ]
        phase_faults += _number_faults([(quantities.PHASE, value, f"phase_s of {PHASES[at]}") for at, value in strange])
    return faults + phase_faults


def _gripper_faults(gripper: GripperReadings) -> list[str]:
    readings = {name: getattr(gripper, name) for name in ("before_m", "closed_m", "lifted_m", "final_m")}
    known = {name: value for name, value in readings.items() if not math.isnan(value)}
    return _number_faults([(quantities.JAW_OPENING, value, f"gripper.{name}") for name, value in known.items()])


def _scene_faults(scene: SceneObjects | None, header: SessionHeader) -> list[str]:
    if scene is None:
        return []
    count = np.size(scene.catalogue_index)
    faults = _array_faults("scene.catalogue_index", scene.catalogue_index, np.int16, (count,))
    if faults:
        return faults
    poses = _array_faults("scene.pose_base_object", scene.pose_base_object, np.float64, (count, 7))
    if not poses and not np.all(np.isfinite(scene.pose_base_object)):
        poses.append("scene.pose_base_object is not finite everywhere")
    elif not poses:
        poses += _position_faults("scene.pose_base_object", scene.pose_base_object[:, :3])
    if count > header.objects_per_scene:
        faults.append(f"scene has {counted(count, 'object')}, expected at most {header.objects_per_scene}")
    faults += _condition_faults(scene.conditions, header.station.conditions)
    known = len(header.station.objects)
    strange = [int(index) for index in scene.catalogue_index if not 0 <= index < known]
    if strange:
        faults.append(f"scene.catalogue_index holds {strange}, expected 0 to {known - 1}")
    if not 0 <= scene.target < count:
        faults.append(f"scene.target is {scene.target}, expected 0 to {count - 1}")
    return faults + poses


def _condition_faults(values: NDArray[np.float64], names: tuple[str, ...]) -> list[str]:
    faults = _array_faults("scene.conditions", values, np.float64, (len(names),))
    if not faults and not np.all(np.isfinite(values)):
        faults.append("scene.conditions is not finite everywhere")
    return faults


def _outcome_faults(attempt: GraspAttempt, station: StationSpec) -> list[str]:
    return _label_faults(attempt, station) if attempt.labelled else _failure_faults(attempt.failure)


def _label_faults(attempt: GraspAttempt, station: StationSpec) -> list[str]:
    label = attempt.outcome.name
    faults = []
    if attempt.failure:
        faults.append(f"failure is {attempt.failure!r} with outcome {label}, expected none")
    if attempt.overhead is None:
        faults.append(f"overhead is missing with outcome {label}, expected the picture the attempt is learnt from")
    final_m = attempt.gripper.final_m
    if math.isnan(final_m):
        faults.append(f"gripper.final_m is NaN with outcome {label}, expected the opening the label was read off")
    elif (final_m > station.closed_width_m) != (attempt.outcome is Outcome.HELD):
        relation = "above" if final_m > station.closed_width_m else "at or below"
        faults.append(
            f"outcome is {label} with gripper.final_m {final_m} m, {relation} the closed width "
            f"{station.closed_width_m} m, expected {'EMPTY' if attempt.outcome is Outcome.HELD else 'HELD'}"
        )
    return faults


def _failure_faults(failure: str) -> list[str]:
    phase, colon, reason = failure.partition(":")
    faults = []
    if phase not in PHASES or not colon or not reason.strip():
        faults.append(f"failure is {failure!r}, expected 'phase: reason' with a phase of {', '.join(PHASES)}")
    if len(failure.encode(errors="replace")) > FAILURE_BYTES or "\0" in failure:
        faults.append(
            f"failure takes {counted(len(failure), 'character')}, expected {FAILURE_BYTES} bytes of UTF-8 without NUL"
        )
    if not failure.isascii() and failure != failure.encode(errors="ignore").decode():
        faults.append("failure holds a lone surrogate, expected text that UTF-8 can write")
    return faults


def _pose_faults(name: str, pose: NDArray[Any], *, optional: bool = False) -> list[str]:
    faults = _array_faults(name, pose, np.float64, (4, 4))
    if faults or (optional and np.all(np.isnan(pose))):
        return faults
    rotation = pose[:3, :3]
    if not np.all(np.isfinite(pose)):
        return [f"{name} is not finite everywhere"]
    if np.abs(rotation).max() > 2:  # Squares of what is far too large would overflow.
        return [f"{name} is no rigid transform: expected an orthonormal rotation and a last row of 0 0 0 1"]
    rigid = np.allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=quantities.ROTATION_ERROR.possible[1])
    if not (rigid and np.linalg.det(rotation) > 0 and np.array_equal(pose[3], (0, 0, 0, 1))):
        return [f"{name} is no rigid transform: expected an orthonormal rotation and a last row of 0 0 0 1"]
    return _position_faults(name, pose[:3, 3])


def _position_faults(name: str, positions: NDArray[np.float64]) -> list[str]:
    """The farthest coordinate, where it is impossible; the others are as wrong."""
    farthest = max(positions.flat, key=abs, default=0.0)
    return _number_faults([(quantities.POSITION, float(farthest), f"a coordinate of {name}")])


def _array_faults(name: str, array: object, dtype: type[np.generic], shape: tuple[int, ...]) -> list[str]:
    if not isinstance(array, np.ndarray):
        return [f"{name} is a {type(array).__name__}, expected an array of {np.dtype(dtype)}"]
    faults = []
    if array.dtype != np.dtype(dtype):
        faults.append(f"{name} has type {array.dtype}, expected {np.dtype(dtype)}")
    if array.shape != shape:
        faults.append(f"{name} has shape {array.shape}, expected {shape}")
    return faults
