"""GD-211 and GD-212: whether the numbers of stations and attempts can be true. Reads neither poses nor pictures."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.format import quantities
from handsight.datasets.format.quantities import Quantity
from handsight.datasets.format.sessions import SessionInfo
from handsight.datasets.format.typed import shown
from handsight.datasets.format.validation import field_of_view_rad, header_faults
from handsight.datasets.integrity.doctor.findings import Finding, attempt_finding, dataset_finding
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import PHASES

_NUMBERS = {
    "contact_force_n": quantities.CONTACT_FORCE,
    "predicted_success": quantities.PROBABILITY,
    **{f"{name}_s": quantities.PHASE for name in PHASES},
}
"""Columns of the attempts table; openings, angles and missing values have checks of their own (``attempts.py``)."""


def plausibility_findings(dataset: GraspDataset) -> Iterator[Finding]:
    """Stations of all sessions, and numbers of the attempts that are not excluded."""
    for session in dataset.sessions:
        yield from _station_findings(session)
    rows = dataset.attempts[~dataset.attempts["excluded"]]
    for name, quantity in _NUMBERS.items():
        values = rows[name].to_numpy(np.float64)
        # Negative durations are GD-205.
        known = np.where(values < 0, np.nan, values) if quantity is quantities.PHASE else values
        yield from _number_findings(rows.index, name, quantity, known)
    started_ns = rows["started"].astype("int64").to_numpy(np.float64)
    elapsed_ns = (rows["elapsed_s"] * 1e9).to_numpy(np.float64)
    for name, quantity, values in (
        ("started_ns", quantities.STARTED, started_ns),
        ("elapsed_ns", quantities.ELAPSED, elapsed_ns),
    ):
        # 0 is not known; a negative total is GD-205.
        yield from _number_findings(rows.index, name, quantity, np.where(values > 0, values, np.nan))


def _station_findings(session: SessionInfo) -> Iterator[Finding]:
    for fault in header_faults(session.header):
        yield dataset_finding("GD-211", "error", f"session {session.ulid}: {fault}")
    yield from _date_findings(session)
    for name, quantity, value in _station_numbers(session):
        if quantity.unlikely(value):
            complaint = quantity.complaint(value, quantity.likely, name)
            yield dataset_finding("GD-212", "warning", f"session {session.ulid}: {complaint}")


def _date_findings(session: SessionInfo) -> Iterator[Finding]:
    for name, text in (("started", session.started), ("ended", session.ended)):
        if text is None:
            continue
        try:
            moment_ns = datetime.fromisoformat(text).timestamp() * 1e9
        except (ValueError, OverflowError):
            said = f"session {session.ulid}: {name} is {shown(text)}, expected a time in ISO 8601"
            yield dataset_finding("GD-211", "error", said)
            continue
        if _unlikely_date(moment_ns):
            said = f"session {session.ulid}: {name} is {text}, expected the years 2000 to 2099"
            yield dataset_finding("GD-212", "warning", said)


def _unlikely_date(moment_ns: float) -> bool:
    return not quantities.STARTED.likely[0] <= moment_ns <= quantities.STARTED.likely[1]


def _station_numbers(session: SessionInfo) -> list[tuple[str, Quantity, float]]:
    station = session.header.station
    camera, lens = station.camera, station.camera.intrinsics
    return [
        ("depth_scale_m", quantities.DEPTH_SCALE, station.depth_scale_m),
        ("gripper_stroke_m", quantities.GRIPPER_STROKE, station.gripper_stroke_m),
        ("closed_width_m", quantities.CLOSED_WIDTH, station.closed_width_m),
        ("pregrasp_height_m", quantities.PREGRASP_HEIGHT, station.pregrasp_height_m),
        ("objects_per_scene", quantities.OBJECTS_PER_SCENE, session.header.objects_per_scene),
        ("picture width", quantities.PICTURE_SIDE, lens.width),
        ("picture height", quantities.PICTURE_SIDE, lens.height),
        ("horizontal field of view", quantities.FIELD_OF_VIEW, field_of_view_rad(lens.width, lens.fx)),
        ("vertical field of view", quantities.FIELD_OF_VIEW, field_of_view_rad(lens.height, lens.fy)),
        ("x_tool_camera_m", quantities.CAMERA_OFFSET, camera.x_tool_camera_m),
        ("y_tool_camera_m", quantities.CAMERA_OFFSET, camera.y_tool_camera_m),
        ("z_tool_camera_m", quantities.CAMERA_OFFSET, camera.z_tool_camera_m),
    ]


def _number_findings(
    attempts: pd.Index[str], name: str, quantity: Quantity, values: NDArray[np.float64]
) -> Iterator[Finding]:
    """What is wrong with one number of each attempt; ``values`` has shape (N,), NaN where it is not known."""
    impossible, unlikely = quantity.impossible(values), quantity.unlikely(values)
    if impossible.any():
        said = quantity.complaint(float(values[impossible][0]), quantity.possible, name)
        yield from attempt_finding("GD-211", "error", attempts[impossible], f"{{attempts}}: {said}")
    if unlikely.any():
        said = quantity.complaint(float(values[unlikely][0]), quantity.likely, name)
        yield from attempt_finding("GD-212", "warning", attempts[unlikely], f"{{attempts}}: {said}")
