"""GD-208, 209, 210 and 213: whether arm, grasp and camera are where they can be. Reads poses, no pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.format import quantities
from handsight.datasets.format.arrays import array_at, read_range
from handsight.datasets.format.quantities import Quantity, Range
from handsight.datasets.format.schema import SESSIONS
from handsight.datasets.format.sessions import SessionInfo
from handsight.datasets.integrity.doctor.findings import Finding, Severity, attempt_finding
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import StationSpec
from handsight.servoing.camera import HandCamera

_ROWS = 16384
"""Attempts whose poses are in memory at a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Check:
    """One number of every attempt that follows from its poses, and what it must be."""

    code: str
    severity: Severity
    what: str
    quantity: Quantity
    expected: Range
    values: NDArray[np.float64]
    """NaN where it is not known. Shape (N,)."""


@dataclass(slots=True, kw_only=True)
class _Found:
    """What a check has found so far."""

    check: _Check
    attempts: list[str] = field(default_factory=list)
    worst: float = 0.0
    """The value farthest from what was expected."""

    def add(self, attempts: pd.Index[str], check: _Check) -> None:
        low, high = check.expected
        excess = np.nan_to_num(np.maximum(low - check.values, check.values - high), nan=-1.0, posinf=np.inf)
        if not (excess > 0).any():
            return
        worst = float(check.values[np.argmax(excess)])
        if not self.attempts or abs(worst) > abs(self.worst):
            self.worst = worst
        self.attempts += attempts[excess > 0].tolist()

    def findings(self) -> list[Finding]:
        if not self.attempts:
            return []
        complaint = self.check.quantity.complaint(round(self.worst, 4), self.check.expected)
        message = f"{{attempts}} {self.check.what}: {complaint}"
        return attempt_finding(self.check.code, self.check.severity, self.attempts, message)


def pose_findings(dataset: GraspDataset) -> Iterator[Finding]:
    """Where the arm, the grasp, the camera and the objects of every attempt are that is not excluded."""
    found: dict[tuple[str, str, Range], _Found] = {}
    rows = dataset.attempts[~dataset.attempts["excluded"]]
    for session in dataset.sessions:
        own = rows[rows["session"] == session.ulid]
        for start in range(0, len(own), _ROWS):
            some = own.iloc[start : start + _ROWS]
            for check in _checks(dataset, session, some):
                known = found.setdefault((check.code, check.what, check.expected), _Found(check=check))
                known.add(some.index, check)
    for one in found.values():
        yield from one.findings()


def grasp_pixels(
    camera: HandCamera, poses_base_tool: NDArray[np.float64], rows: pd.DataFrame
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the grasp point on the table appears in pictures; NaN where it is not before the camera.

    Args:
        camera: The session's.
        poses_base_tool: The tool when the pictures were taken. Shape (N, 4, 4).
        rows: Of the attempts table; gives the grasp points.

    Returns:
        The columns and rows of the pixels, shape (N,) each.
    """
    points = np.stack([rows["pregrasp_x_m"], rows["pregrasp_y_m"], np.zeros(len(rows))], axis=1)  # (N, 3), base
    in_tool = np.einsum("nij,ni->nj", poses_base_tool[:, :3, :3], points - poses_base_tool[:, :3, 3])
    in_camera = in_tool - (camera.x_tool_camera_m, camera.y_tool_camera_m, camera.z_tool_camera_m)
    lens = camera.intrinsics
    depth = np.where(in_camera[:, 2] > 0, in_camera[:, 2], np.nan)
    return lens.fx * in_camera[:, 0] / depth + lens.cx, lens.fy * in_camera[:, 1] / depth + lens.cy


def _checks(dataset: GraspDataset, session: SessionInfo, rows: pd.DataFrame) -> Iterator[_Check]:
    grasp = _stored(dataset, session, "attempts/pose_base_tool_grasp", rows)  # (N, 4, 4), NaN where never closed
    overhead = _stored(dataset, session, "overhead/pose_base_tool", rows)  # (N, 4, 4), NaN where there is no picture
    labelled = rows["recorded_success"].notna().to_numpy(bool)
    # A pose that was only commanded may well be out of reach: that is how such an attempt ends.
    goal = np.where(labelled[:, None], rows[["pregrasp_x_m", "pregrasp_y_m"]].to_numpy(np.float64), np.nan)  # (N, 2)
    station = session.header.station
    yield from _reach_checks(station, grasp, overhead, goal)
    yield from _height_checks(station, grasp, overhead)
    yield _picture_check(station, overhead, rows, labelled)
    yield from _grasp_checks(grasp, goal)
    yield from _object_checks(_stored(dataset, session, "attempts/pose_base_object", rows))


def _reach_checks(
    station: StationSpec, grasp: NDArray[np.float64], overhead: NDArray[np.float64], goal: NDArray[np.float64]
) -> Iterator[_Check]:
    reach = quantities.REACH
    distances = [np.linalg.norm(pose[:, :3, 3], axis=1) for pose in (grasp, overhead)]
    distance = np.fmax.reduce([*distances, np.linalg.norm(goal, axis=1)])
    known = (0, quantities.REACH_OF_SOURCE_M.get(station.source, reach.possible[1]))
    yield _Check(
        code="GD-208",
        severity="error",
        what="with a pose out of the arm's reach",
        quantity=reach,
        expected=known,
        values=distance,
    )
    yield _Check(
        code="GD-212",
        severity="warning",
        what="with a pose far from the arm",
        quantity=reach,
        expected=reach.likely,
        values=np.where(distance > known[1], np.nan, distance),
    )


def _height_checks(station: StationSpec, grasp: NDArray[np.float64], overhead: NDArray[np.float64]) -> Iterator[_Check]:
    camera = station.camera
    offset = np.array((camera.x_tool_camera_m, camera.y_tool_camera_m, camera.z_tool_camera_m))
    height, camera_height = grasp[:, 2, 3], overhead[:, 2, 3] + overhead[:, 2, :3] @ offset
    for what, quantity, values in (
        ("with the jaws closed under the table or high in the air", quantities.GRASP_HEIGHT, height),
        ("with the jaws closed above the camera", quantities.CAMERA_CLEARANCE, camera_height - height),
        ("with the camera under the table or high in the air", quantities.CAMERA_HEIGHT, camera_height),
    ):
        expected = quantity.possible
        yield _Check(code="GD-209", severity="error", what=what, quantity=quantity, expected=expected, values=values)


def _picture_check(
    station: StationSpec, overhead: NDArray[np.float64], rows: pd.DataFrame, labelled: NDArray[np.bool_]
) -> _Check:
    """How many pictures lie between the grasp and the picture: 0 inside of it. Those just outside are GD-203."""
    lens = station.camera.intrinsics
    away = np.zeros(len(rows))
    for pixels, size in zip(grasp_pixels(station.camera, overhead, rows), (lens.width, lens.height), strict=True):
        # What is not before the camera is in no picture of it.
        away = np.maximum(away, np.nan_to_num(np.maximum(-pixels, pixels - (size - 1)) / size, nan=np.inf))
    quantity = quantities.PICTURES_AWAY
    return _Check(
        code="GD-210",
        severity="error",
        what="with the grasp far outside the overhead picture",
        quantity=quantity,
        expected=quantity.possible,
        values=np.where(labelled & rows["overhead_taken"].to_numpy(bool), away, np.nan),
    )


def _grasp_checks(grasp: NDArray[np.float64], goal: NDArray[np.float64]) -> Iterator[_Check]:
    tilt = np.arccos(np.clip(-grasp[:, 2, 2], -1, 1))
    for what, quantity, values in (
        ("with the jaws closed elsewhere", quantities.GRASP_OFFSET, np.linalg.norm(grasp[:, :2, 3] - goal, axis=1)),
        ("with a tilted tool", quantities.TOOL_TILT, tilt),
    ):
        expected = quantity.likely
        yield _Check(code="GD-213", severity="warning", what=what, quantity=quantity, expected=expected, values=values)


def _object_checks(objects: NDArray[np.float64]) -> Iterator[_Check]:
    """The object of each scene that is farthest from what is likely. ``objects`` has shape (N, M, 7)."""
    distance = np.asarray(np.fmax.reduce(np.linalg.norm(objects[:, :, :3], axis=2), axis=1), np.float64)
    lengths = np.linalg.norm(objects[:, :, 3:], axis=2)
    longest, shortest = np.fmax.reduce(lengths, axis=1), np.fmin.reduce(lengths, axis=1)
    length = np.asarray(np.where(longest - 1 > 1 - shortest, longest, shortest), np.float64)
    for what, quantity, values in (
        ("with objects far from the arm", quantities.OBJECT_DISTANCE, distance),
        ("with an object's rotation that is none", quantities.QUATERNION_NORM, length),
    ):
        expected = quantity.likely
        yield _Check(code="GD-212", severity="warning", what=what, quantity=quantity, expected=expected, values=values)


def _stored(dataset: GraspDataset, session: SessionInfo, path: str, rows: pd.DataFrame) -> NDArray[np.float64]:
    """The rows of an array of the session that belong to rows of the attempts table."""
    numbers = rows["number"].to_numpy(np.int64)
    array = array_at(dataset.root, f"{SESSIONS}/{session.ulid}/{path}")
    first = int(numbers.min())
    return np.asarray(read_range(array, first, int(numbers.max()) + 1)[numbers - first], np.float64)
