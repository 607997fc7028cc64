"""The attempts of a dataset as a pandas table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.records import PHASES, Outcome
from handsight.datasets.rows import text_from_bytes
from handsight.datasets.schema import COLUMNS, VIEWS, attempt_id
from handsight.datasets.sessions import SessionInfo

Columns = Mapping[str, NDArray[Any]]
"""The columns of one session by name, with the rows first."""


def attempts_table(sessions: Sequence[tuple[SessionInfo, Columns]]) -> pd.DataFrame:
    """One row for each attempt, indexed by its id, in the order of sessions and numbers.

    ``success`` is missing where the attempt carries no label, ``truth_held`` where there is no truth, ``seed`` and
    ``target`` where they are not known. Lengths in metres, angles in radians, times in seconds, ``started`` in UTC.
    """
    frames = [_session_table(info, columns) for info, columns in sessions if info.attempts]
    return pd.concat(frames) if frames else _session_table(None, _no_columns())


def _session_table(info: SessionInfo | None, columns: Columns) -> pd.DataFrame:
    rows = len(columns["number"])
    outcome = columns["outcome"]
    labelled = (outcome == Outcome.EMPTY) | (outcome == Outcome.HELD)
    x_m, y_m, angle_rad = columns["pregrasp_x_y_angle"].T
    before_m, closed_m, lifted_m, final_m = columns["gripper_width_m"].T
    started_ns, elapsed_ns = columns["started_elapsed_ns"].T
    objects = _object_names(info, columns)
    targets = [None if at < 0 else names[at] for names, at in zip(objects, columns["target"], strict=True)]
    ulid = "" if info is None else info.ulid
    seed = None if info is None else info.header.seed
    source = "" if info is None else info.header.station.source
    values = {
        "session": _text([ulid] * rows),
        "number": columns["number"],
        "source": _text([source] * rows),
        "seed": pd.array([pd.NA if seed is None else seed] * rows, dtype="Int64"),
        "outcome": _text([Outcome(value).name.lower() for value in outcome]),
        "success": pd.arrays.BooleanArray(outcome == Outcome.HELD, ~labelled),
        "truth_held": pd.arrays.BooleanArray(columns["truth_held"] == 1, columns["truth_held"] < 0),
        "failure": _text([text_from_bytes(value) for value in columns["failure"]]),
        "objects": pd.Series(objects, dtype=object).to_numpy(),
        "target": _text(targets),
        **{f"{view}_taken": columns["picture_taken"][:, at] for at, view in enumerate(VIEWS)},
        "pregrasp_x_m": x_m,
        "pregrasp_y_m": y_m,
        "pregrasp_angle_rad": angle_rad,
        "width_before_m": before_m,
        "width_closed_m": closed_m,
        "width_lifted_m": lifted_m,
        "width_final_m": final_m,
        "contact_force_n": columns["contact_force_n"],
        **{f"{phase}_s": columns["phase_s"][:, at] for at, phase in enumerate(PHASES)},
        "started": pd.to_datetime(started_ns, unit="ns", utc=True),
        "elapsed_s": elapsed_ns / 1e9,
        "digest": _text([value.tobytes().hex() for value in columns["digest"]]),
    }
    ids = [attempt_id(ulid, int(number)) for number in columns["number"]]
    return pd.DataFrame(values, index=pd.Index(ids, name="attempt", dtype="str"))


def _text(values: Sequence[str | None]) -> Any:
    return pd.array(values, dtype="str")


def _object_names(info: SessionInfo | None, columns: Columns) -> list[tuple[str, ...]]:
    catalogue = () if info is None else info.header.station.objects
    indices = zip(columns["catalogue_index"], columns["object_count"], strict=True)
    return [tuple(catalogue[index] for index in row[: max(count, 0)]) for row, count in indices]


def _no_columns() -> Columns:
    return {column.name: np.empty((0, *column.shape(1)), dtype=column.dtype) for column in COLUMNS}
