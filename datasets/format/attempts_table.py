"""The attempts of a dataset as a pandas table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import repeat
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.format.rows import text_from_bytes
from handsight.datasets.format.schema import COLUMNS, VIEWPOINTS, ColumnWidths, attempt_ids
from handsight.datasets.format.sessions import SessionInfo
from handsight.datasets.format.stored_values import impossible
from handsight.datasets.records import PHASES, Outcome

Columns = Mapping[str, NDArray[Any]]
"""The columns of one session by name, with the rows first. One that reads on access is read only where it is needed."""

Build = Callable[[SessionInfo | None, Columns], Any]
"""Makes one column of the table for the rows of one session."""


class LazyColumns(Mapping[str, NDArray[Any]]):
    """Columns that are read when they are asked for, each once."""

    def __init__(self, read: Callable[[str], NDArray[Any]]) -> None:
        self._read = read
        self._known: dict[str, NDArray[Any]] = {}

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._known:
            self._known[name] = self._read(name)
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return (column.name for column in COLUMNS)

    def __len__(self) -> int:
        return len(COLUMNS)


def attempts_table(
    sessions: Sequence[tuple[SessionInfo, Columns]],
    names: Iterable[str] | None = None,
    *,
    conditions: Iterable[str] = (),
) -> pd.DataFrame:
    """One row for each attempt, indexed by its id, in the order of sessions and numbers.

    ``success`` is missing where the attempt carries no label, ``truth_held`` where there is no truth, ``seed`` and
    ``target`` where they are not known. Conditions that were varied have columns of their own. Lengths in metres,
    angles in radians, times in seconds, ``started`` in UTC.

    Args:
        sessions: The sessions and what they recorded.
        names: Columns of the table to make; None for all. A million rows take a second for some of them.
        conditions: Those that any session of the dataset varied; each is a column, whichever sessions are here.
    """
    makers = dict(TABLE)
    for condition in conditions:
        makers[condition] = _condition(condition)
    wanted = {name: makers[name] for name in (makers if names is None else names)}
    frames = [_session_table(info, columns, wanted) for info, columns in sessions if info.attempts]
    return pd.concat(frames) if frames else _session_table(None, _no_columns(), wanted)


def _session_table(info: SessionInfo | None, columns: Columns, makers: Mapping[str, Build]) -> pd.DataFrame:
    ids = attempt_ids("" if info is None else info.ulid, columns["number"].tolist())
    values = {name: build(info, columns) for name, build in makers.items()}
    return pd.DataFrame(values, index=pd.Index(ids, name="attempt", dtype="str"))


def _text(values: Any) -> Any:
    return pd.array(values, dtype="str")


def _repeated(text: str, columns: Columns) -> Any:
    return _text(list(repeat(text, len(columns["number"]))))


def _seed(info: SessionInfo | None, columns: Columns) -> Any:
    seed = None if info is None else info.header.seed
    rows = len(columns["number"])
    return pd.arrays.IntegerArray(np.full(rows, seed or 0, np.int64), np.full(rows, seed is None))


def _outcome(info: SessionInfo | None, columns: Columns) -> Any:
    names = np.array([outcome.name.lower() for outcome in Outcome], dtype=object)
    return _text(names[columns["outcome"]])


def _success(info: SessionInfo | None, columns: Columns) -> Any:
    outcome = columns["outcome"]
    labelled = (outcome == Outcome.EMPTY) | (outcome == Outcome.HELD)
    return pd.arrays.BooleanArray(outcome == Outcome.HELD, ~labelled)


def _truth_held(info: SessionInfo | None, columns: Columns) -> Any:
    return pd.arrays.BooleanArray(columns["truth_held"] == 1, columns["truth_held"] < 0)


def _failure(info: SessionInfo | None, columns: Columns) -> Any:
    texts = np.full(len(columns["failure"]), "", dtype=object)
    for row in np.flatnonzero(columns["failure"][:, 0]):
        texts[row] = text_from_bytes(columns["failure"][row])
    return _text(texts)


def _objects(info: SessionInfo | None, columns: Columns) -> Any:
    catalogue = () if info is None else info.header.station.objects
    indices, counts = columns["catalogue_index"], columns["object_count"]
    _refuse_unnamed(info, columns, (indices < 0) & (np.arange(indices.shape[1]) < counts[:, None]))
    rows = zip(indices.tolist(), counts.tolist(), strict=True)
    names = [tuple(catalogue[index] for index in row[: max(count, 0)]) for row, count in rows]
    return pd.Series(names, dtype=object).to_numpy()


def _target(info: SessionInfo | None, columns: Columns) -> Any:
    """Names of the targets; index -1, of the last place, stands for none."""
    catalogue = np.array([*(() if info is None else info.header.station.objects), None], dtype=object)
    return _text(catalogue[targets_in_catalogue(info, columns)])


def targets_in_catalogue(info: SessionInfo | None, columns: Columns) -> NDArray[np.int64]:
    """Index of each attempt's target in the session's catalogue; -1 where there is none. Shape (N,).

    Raises:
        CorruptDataError: A target is none of the objects of its scene.
    """
    target = columns["target"].astype(np.int64)
    index = columns["catalogue_index"][np.arange(len(target)), np.maximum(target, 0)].astype(np.int64)
    _refuse_unnamed(info, columns, (index < 0) & (target >= 0))
    return np.where(target < 0, -1, index)


def _refuse_unnamed(info: SessionInfo | None, columns: Columns, unnamed: NDArray[np.bool_]) -> None:
    """Refuse objects without an index, which in Python would mean the last one of the catalogue."""
    rows = np.flatnonzero(unnamed.any(axis=tuple(range(1, unnamed.ndim))))
    if info is not None and len(rows):
        number, indices = int(columns["number"][rows[0]]), columns["catalogue_index"][rows[0]]
        raise impossible(info.ulid, number, "catalogue_index", indices, "an index for every object of the scene")


def _digest(info: SessionInfo | None, columns: Columns) -> Any:
    rows = columns["digest"]
    text, width = rows.tobytes().hex(), 2 * rows.shape[1]
    return _text([text[start : start + width] for start in range(0, len(text), width)])


def _condition(name: str) -> Build:
    """A condition that was varied; NaN in sessions that did not vary it."""

    def build(info: SessionInfo | None, columns: Columns) -> Any:
        names = () if info is None else info.header.station.conditions
        if name not in names:
            return np.full(len(columns["number"]), np.nan)
        return columns["conditions"][:, names.index(name)]

    return build


def _part(name: str, at: int) -> Build:
    return lambda info, columns: columns[name][:, at]


TABLE: dict[str, Build] = {
    "session": lambda info, columns: _repeated("" if info is None else info.ulid, columns),
    "number": lambda info, columns: columns["number"],
    "source": lambda info, columns: _repeated("" if info is None else info.header.station.source, columns),
    "seed": _seed,
    "outcome": _outcome,
    "success": _success,
    "truth_held": _truth_held,
    "failure": _failure,
    "objects": _objects,
    "target": _target,
    **{f"{viewpoint}_taken": _part("picture_taken", at) for at, viewpoint in enumerate(VIEWPOINTS)},
    "pregrasp_x_m": _part("pregrasp_x_y_angle", 0),
    "pregrasp_y_m": _part("pregrasp_x_y_angle", 1),
    "pregrasp_angle_rad": _part("pregrasp_x_y_angle", 2),
    "predicted_success": lambda info, columns: columns["predicted_success"],
    "width_before_m": _part("gripper_width_m", 0),
    "width_closed_m": _part("gripper_width_m", 1),
    "width_lifted_m": _part("gripper_width_m", 2),
    "width_final_m": _part("gripper_width_m", 3),
    "contact_force_n": lambda info, columns: columns["contact_force_n"],
    **{f"{phase}_s": _part("phase_s", at) for at, phase in enumerate(PHASES)},
    "started": lambda info, columns: pd.to_datetime(columns["started_elapsed_ns"][:, 0], unit="ns", utc=True),
    "elapsed_s": lambda info, columns: columns["started_elapsed_ns"][:, 1] / 1e9,
    "digest": _digest,
}
"""How each column of the table is made, in the order in which they stand."""


def _no_columns() -> Columns:
    return {column.name: np.empty((0, *column.shape(ColumnWidths(1, 1))), dtype=column.dtype) for column in COLUMNS}
