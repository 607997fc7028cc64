"""What a record must satisfy before it is stored. Every check adds to one list, so that all faults show at once."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import counted
from handsight.datasets.format.attempts_table import TABLE
from handsight.datasets.format.header import canonical_json
from handsight.datasets.format.rows import frame_of
from handsight.datasets.format.schema import FAILURE_BYTES, VIEWPOINTS
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
from handsight.servoing.camera import Intrinsics

_ROTATION_TOLERANCE = 1e-4
"""Largest departure from orthonormality of a rotation that a station measured."""

LARGEST_SIDE_PX = 8192
"""Larger than any depth camera. An imported file must not have memory set aside for whatever it claims."""

_INT64_MAX = 2**63 - 1
_INT16_MAX = 2**15 - 1


def header_faults(header: SessionHeader) -> list[str]:
    """What keeps a session with this header from being recorded; empty when nothing does."""
    faults = _station_faults(header.station)
    if header.seed is not None and not 0 <= header.seed <= _INT64_MAX:
        faults.append(f"seed is {header.seed}, expected 0 to 2**63 - 1, or None")
    if not 0 <= header.objects_per_scene <= _INT16_MAX:
        faults.append(f"objects_per_scene is {header.objects_per_scene}, expected 0 to {_INT16_MAX}")
    try:
        canonical_json(header.config)
    except (TypeError, ValueError) as error:
        faults.append(f"config is not JSON: {error}")
    return faults


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
    for name in ("started_ns", "elapsed_ns"):
        value = getattr(attempt, name)
        if not 0 <= value <= _INT64_MAX:
            faults.append(f"{name} is {value}, expected 0 to 2**63 - 1")
    return faults


def _station_faults(station: StationSpec) -> list[str]:
    faults = []
    if not re.fullmatch(r"[a-z][a-z0-9_-]*", station.source):
        faults.append(f"source is {station.source!r}, expected a lower-case word such as sim or ur10")
    if not (math.isfinite(station.depth_scale_m) and station.depth_scale_m > 0):
        faults.append(f"depth_scale_m is {station.depth_scale_m}, expected positive metres per unit")
    if not (math.isfinite(station.pregrasp_height_m) and station.pregrasp_height_m > 0):
        faults.append(f"pregrasp_height_m is {station.pregrasp_height_m}, expected positive metres")
    if not (math.isfinite(station.gripper_stroke_m) and 0 <= station.closed_width_m < station.gripper_stroke_m):
        faults.append(
            f"closed_width_m is {station.closed_width_m} and gripper_stroke_m {station.gripper_stroke_m}, "
            "expected 0 <= closed < stroke"
        )
    camera = station.camera
    if max(camera.intrinsics.width, camera.intrinsics.height) > LARGEST_SIDE_PX:
        faults.append(
            f"pictures are {camera.intrinsics.width}x{camera.intrinsics.height}, expected at most {LARGEST_SIDE_PX} "
            "pixels a side"
        )
    offset = (camera.x_tool_camera_m, camera.y_tool_camera_m, camera.z_tool_camera_m)
    if not all(math.isfinite(value) for value in offset):
        faults.append(f"camera offset is {offset} m, expected finite")
    for kind in ("objects", "conditions"):
        names = getattr(station, kind)
        if len(set(names)) != len(names):
            twice = sorted({name for name in names if names.count(name) > 1})
            faults.append(f"{kind} names {', '.join(twice)} more than once")
    strange = [name for name in station.conditions if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or name in TABLE]
    if strange:
        faults.append(
            f"conditions names {', '.join(map(repr, strange))}, expected words such as table_friction that are no "
            "columns of the attempts table already"
        )
    return faults


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
    predicted = attempt.predicted_success
    if not (math.isnan(predicted) or 0 <= predicted <= 1):
        faults.append(f"predicted_success is {predicted}, expected 0 to 1, or NaN")
    if not math.isfinite(attempt.contact_force_n):
        faults.append(f"contact_force_n is {attempt.contact_force_n}, expected finite")
    pose = attempt.pose_base_tool_grasp
    faults += _pose_faults("pose_base_tool_grasp", pose, optional=not attempt.labelled)
    phase_faults = _array_faults("phase_s", attempt.phase_s, np.float32, (len(PHASES),))
    if not phase_faults and np.any(np.isinf(attempt.phase_s) | (attempt.phase_s < 0)):
        phase_faults.append(f"phase_s is {attempt.phase_s.tolist()}, expected 0 or more, or NaN for a phase not run")
    return faults + phase_faults


def _gripper_faults(gripper: GripperReadings) -> list[str]:
    readings = {name: getattr(gripper, name) for name in ("before_m", "closed_m", "lifted_m", "final_m")}
    return [
        f"gripper.{name} is {value}, expected finite or NaN" for name, value in readings.items() if math.isinf(value)
    ]


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
        faults.append(f"failure takes {len(failure)} characters, expected {FAILURE_BYTES} bytes of UTF-8 without NUL")
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
    rigid = np.allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=_ROTATION_TOLERANCE)
    if not (rigid and np.linalg.det(rotation) > 0 and np.array_equal(pose[3], (0, 0, 0, 1))):
        return [f"{name} is no rigid transform: expected an orthonormal rotation and a last row of 0 0 0 1"]
    return []


def _array_faults(name: str, array: object, dtype: type[np.generic], shape: tuple[int, ...]) -> list[str]:
    if not isinstance(array, np.ndarray):
        return [f"{name} is a {type(array).__name__}, expected an array of {np.dtype(dtype)}"]
    faults = []
    if array.dtype != np.dtype(dtype):
        faults.append(f"{name} has type {array.dtype}, expected {np.dtype(dtype)}")
    if array.shape != shape:
        faults.append(f"{name} has shape {array.shape}, expected {shape}")
    return faults
