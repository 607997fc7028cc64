"""GD-2xx: whether what was recorded of an attempt can be true. Reads no pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pandas as pd

from handsight.datasets.format.arrays import array_at, read_range
from handsight.datasets.format.schema import SESSIONS
from handsight.datasets.format.sessions import SessionInfo
from handsight.datasets.integrity.doctor.findings import Finding, attempt_finding
from handsight.datasets.integrity.doctor.poses import grasp_pixels
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import PHASES

_WIDTHS = ["width_before_m", "width_closed_m", "width_lifted_m", "width_final_m"]
_POSE = ["pregrasp_x_m", "pregrasp_y_m", "pregrasp_angle_rad"]
_WIDTH_TOLERANCE_M = 2e-3
"""How far a gripper's reading may lie outside its stroke."""

_TRUTH_DISAGREEMENT = 0.01
"""Share of labels that may differ from the simulator's truth."""

_TIMING_SLACK_S = 1.0


def attempt_findings(dataset: GraspDataset) -> Iterator[Finding]:
    """Values, gripper, grasp pose, timing and label of every attempt that is not excluded."""
    rows = dataset.attempts[~dataset.attempts["excluded"]]
    yield from _value_findings(rows)
    for session in dataset.sessions:
        own = rows[rows["session"] == session.ulid]
        yield from _gripper_findings(session, own)
        yield from _crop_findings(dataset, session, own)
        yield from _clock_findings(session, own)
    yield from _truth_findings(rows)


def _value_findings(rows: pd.DataFrame) -> Iterator[Finding]:
    labelled = rows[rows["recorded_success"].notna()]
    missing = ~np.isfinite(labelled[[*_POSE, "width_final_m"]].to_numpy()).all(axis=1)
    infinite = np.isinf(rows.select_dtypes("float64").to_numpy()).any(axis=1)
    yield from attempt_finding(
        "GD-201",
        "error",
        sorted({*labelled.index[missing], *rows.index[infinite]}),
        "{attempts} without a finite grasp pose or final opening, or with an infinite value",
    )
    yield from attempt_finding(
        "GD-204",
        "warning",
        rows.index[rows["pregrasp_angle_rad"].abs() > math.pi + 1e-9],
        "{attempts} with a grasp angle beyond ±π rad: degrees, or an angle that was never wrapped",
    )
    phases = rows[[f"{name}_s" for name in PHASES]]
    yield from attempt_finding(
        "GD-205",
        "warning",
        rows.index[(phases < 0).any(axis=1) | (rows["elapsed_s"] < 0)],
        "{attempts} with a phase or a total of negative duration",
    )


def _gripper_findings(session: SessionInfo, rows: pd.DataFrame) -> Iterator[Finding]:
    station = session.header.station
    widths = rows[_WIDTHS]
    outside = (widths < -_WIDTH_TOLERANCE_M) | (widths > station.gripper_stroke_m + _WIDTH_TOLERANCE_M)
    yield from attempt_finding(
        "GD-202",
        "error",
        rows.index[outside.any(axis=1)],
        f"{{attempts}} with a gripper opening outside 0 to {station.gripper_stroke_m} m: wrong unit or sensor",
    )
    labelled = rows[rows["recorded_success"].notna() & rows["width_final_m"].notna()]
    held = labelled["width_final_m"] > station.closed_width_m
    yield from attempt_finding(
        "GD-206",
        "error",
        labelled.index[held.to_numpy() != labelled["recorded_success"].to_numpy(dtype=bool)],
        f"{{attempts}} labelled against the final opening (closed at or below {station.closed_width_m} m)",
    )


def _crop_findings(dataset: GraspDataset, session: SessionInfo, rows: pd.DataFrame) -> Iterator[Finding]:
    """Where the grasp point on the table appears in the overhead picture."""
    rows = rows[rows["overhead_taken"] & rows["recorded_success"].notna()]
    root = dataset.root
    array = array_at(root, f"{SESSIONS}/{session.ulid}/overhead/pose_base_tool")
    poses = read_range(array, 0, session.attempts)[rows["number"].to_numpy()]  # (N, 4, 4)
    camera = session.header.station.camera
    lens = camera.intrinsics
    u, v = grasp_pixels(camera, poses, rows)
    inside = (u >= 0) & (u <= lens.width - 1) & (v >= 0) & (v <= lens.height - 1)
    yield from attempt_finding(
        "GD-203",
        "note",
        rows.index[~inside],
        "{attempts} with the grasp outside the overhead picture: half of the input or more is replicated edge",
    )


def _clock_findings(session: SessionInfo, rows: pd.DataFrame) -> Iterator[Finding]:
    """Attempts of a rig follow one another; those of a simulation may be performed by several workers."""
    if session.header.seed is not None:
        return
    started = rows["started"]
    ended = started + pd.to_timedelta(rows["elapsed_s"] - _TIMING_SLACK_S, unit="s")
    phases = rows[[f"{name}_s" for name in PHASES]].sum(axis=1)
    early = (started < ended.shift()) | (phases > rows["elapsed_s"] + _TIMING_SLACK_S)
    yield from attempt_finding(
        "GD-205",
        "warning",
        rows.index[early],
        "{attempts} begun before the one before had ended, or done in less time than the phases took",
    )


def _truth_findings(rows: pd.DataFrame) -> Iterator[Finding]:
    known = rows[rows["success"].notna() & rows["truth_held"].notna()]
    wrong = known.index[(known["success"] != known["truth_held"]).astype(bool)]
    if len(wrong) > _TRUTH_DISAGREEMENT * len(known):
        share = len(wrong) / len(known)
        yield from attempt_finding(
            "GD-207",
            "warning",
            wrong,
            f"{{attempts}} ({share:.1%}) labelled otherwise than the simulator knows to be true",
        )
