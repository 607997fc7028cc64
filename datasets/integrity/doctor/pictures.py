"""GD-30x: whether pictures show something, at a plausible distance. One pass over all of them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from handsight.datasets.errors import CorruptDataError, pasteable
from handsight.datasets.format.quantities import DEPTH
from handsight.datasets.format.schema import VIEWPOINTS
from handsight.datasets.integrity.doctor.findings import Finding, Severity, attempt_finding, dataset_finding
from handsight.datasets.integrity.doctor.near_duplicates import picture_hash
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import RgbdFrame

_BLANK_DEVIATION = 1.0
"""Standard deviation of the grey levels below which a picture shows nothing."""

_MOST_HOLES = 0.4
"""Share of invalid depth above which a picture is suspicious; stereo cameras lose up to a third at the borders."""

_DEPTH_RATIO = (0.4, 1.5)
"""Median depth against the height of the camera above the table; objects are nearer, slanted views farther."""

_STEP = 4
"""Every so many pixels of a row and of a column are looked at."""

_COLUMNS = ["attempt", "session", "viewpoint", "digest", "deviation", "holes", "depth_m", "depth_ratio"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureFacts:
    """What the checks need of all pictures, in the order of the attempts."""

    table: pd.DataFrame
    """One row for each picture: attempt, session, viewpoint, digest of its colours, deviation of its grey levels, share
    of holes, median depth, and that against the camera's height."""
    hashes: dict[str, int]
    """Perceptual hash of each overhead picture by attempt."""


def picture_facts(dataset: GraspDataset, on_picture: Callable[[], None] | None = None) -> PictureFacts:
    """Look at every picture of the attempts that are not excluded.

    Raises:
        CorruptDataError: A picture is damaged.
    """
    rows = []
    hashes = {}
    kept = dataset.attempts[~dataset.attempts["excluded"]]
    for viewpoint in VIEWPOINTS:
        for attempt, frame in dataset.frames(viewpoint, kept.index[kept[f"{viewpoint}_taken"]]):
            session = dataset.session(attempt).ulid
            rows.append(
                {"attempt": attempt, "session": session, "viewpoint": viewpoint, **_facts(dataset, attempt, frame)}
            )
            if viewpoint == "overhead":
                hashes[attempt] = picture_hash(frame.rgb)
            if on_picture is not None:
                on_picture()
    return PictureFacts(table=pd.DataFrame(rows, columns=_COLUMNS), hashes=hashes)


def picture_findings(facts: PictureFacts) -> Iterator[Finding]:
    """Blank and frozen pictures, holes, units, repeated pictures."""
    table = facts.table
    blank = table["deviation"] < _BLANK_DEVIATION
    yield from _about("GD-301", "error", table[blank], "{attempts} with a picture that is black or of one colour")
    seen = table[~blank]
    frozen = _frozen(seen)
    yield from _about(
        "GD-302", "error", seen[frozen], "{attempts} with the picture of the attempt before: the camera was frozen"
    )
    twice = seen[~frozen].duplicated("digest", keep=False)
    yield from _about("GD-306", "warning", seen[~frozen][twice], "{attempts} with the same picture as another attempt")
    holes = table["holes"] > _MOST_HOLES
    yield from _about(
        "GD-303", "warning", table[holes], f"{{attempts}} without depth in over {_MOST_HOLES:.0%} of a picture"
    )
    low, high = _DEPTH_RATIO
    off = table[~holes & ~table["depth_ratio"].between(low, high)]
    ratio = off["depth_ratio"].median()
    yield from _about(
        "GD-304",
        "error",
        off,
        f"{{attempts}} with depth at {ratio:.3g} times the camera's height: check depth_scale_m and the mount",
    )
    odd = table[
        ~holes & table["depth_ratio"].between(low, high) & DEPTH.unlikely(table["depth_m"].to_numpy(np.float64))
    ]
    if len(odd):
        said = DEPTH.complaint(round(float(odd["depth_m"].iloc[0]), 4), DEPTH.likely)
        yield from _about("GD-212", "warning", odd, f"{{attempts}}, most of a picture: {said}")


def intrinsics_findings(dataset: GraspDataset) -> Iterator[Finding]:
    """Whether the camera that a session describes can have taken pictures of that size."""
    for session in dataset.sessions:
        lens = session.header.station.camera.intrinsics
        centred = abs(lens.cx / lens.width - 0.5) < 0.2 and abs(lens.cy / lens.height - 0.5) < 0.2
        if not centred or not 0.8 < lens.fx / lens.fy < 1.25:
            yield dataset_finding(
                "GD-305",
                "error",
                f"session {session.ulid}: focal lengths ({lens.fx:.1f}, {lens.fy:.1f}) px and principal point "
                f"({lens.cx:.1f}, {lens.cy:.1f}) px do not fit pictures of {lens.width}x{lens.height}",
            )


def damage_finding(dataset: GraspDataset, error: CorruptDataError) -> Finding:
    """That pictures could not be looked at."""
    verify = pasteable("handsight", "dataset", "verify", f"{dataset.repository.path}@{dataset.ref}")
    return dataset_finding("GD-106", "error", f"{error}; everything that is damaged is named by {verify}")


def _facts(dataset: GraspDataset, attempt: str, frame: RgbdFrame) -> dict[str, object]:
    station = dataset.station(attempt)
    depth = frame.depth[::_STEP, ::_STEP]
    valid = depth[depth > 0]
    height_m = float(frame.pose_base_tool[2, 3]) - station.camera.z_tool_camera_m
    median_m = float(np.median(valid)) * station.depth_scale_m if len(valid) else float("nan")
    return {
        "digest": hashlib.sha256(np.ascontiguousarray(frame.rgb).data).digest(),
        "deviation": float(frame.rgb[::_STEP, ::_STEP].mean(axis=2).std()),
        "holes": 1 - len(valid) / depth.size,
        "depth_m": median_m,
        "depth_ratio": median_m / height_m if height_m > 0 else float("nan"),
    }


def _frozen(table: pd.DataFrame) -> pd.Series[bool]:
    """Whether a picture is that of the attempt before it in the same session, in the same viewpoint."""
    before = table.groupby(["session", "viewpoint"])["digest"].shift()
    return before == table["digest"]


def _about(code: str, severity: Severity, rows: pd.DataFrame, message: str) -> list[Finding]:
    return attempt_finding(code, severity, dict.fromkeys(rows["attempt"]), message)
