"""What the user of a LeRobot export changed in the columns that LeRobot reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from handsight.datasets.errors import CorruptDataError, counted, headline
from handsight.datasets.exchange.edits import Comparison, Edits, session_ids
from handsight.datasets.format.schema import VIEWPOINTS
from handsight.servoing.planar import PlanarPose

_LABELS = ("next.success", "next.reward")
_PLACES = ("episode_index", "index", "frame_index", "task_index")
_COLUMNS = (*_LABELS, "action", "observation.state", *_PLACES)

_Columns = dict[str, NDArray[np.generic]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """What an export holds of a session beside LeRobot's own files; checked by type and shape."""

    ulid: str
    size: int
    """Number of attempts."""
    first_episode: int
    """Episode of the first of them."""
    columns: Mapping[str, NDArray[Any]]
    """By path in the session's group, with the attempts first."""


def edits_of(path: Path, sessions: Sequence[Recorded]) -> Edits:
    """Compare the rows of the data files with the columns of their sessions.

    Args:
        path: The export.
        sessions: What it holds of them.

    Raises:
        InterchangeError: Something was changed that no decision can hold; the message lists it.
        CorruptDataError: A data file is damaged.
        ValueError: Sessions begin where there are no episodes.
    """
    comparison = Comparison(path.name)
    rows = _rows(path)
    found, expected = len(rows["episode_index"]), sum(one.size for one in sessions)
    if found != expected:
        comparison.refuse(f"there are {counted(found, 'row')} of {counted(expected, 'attempt')}", ["data"])
        return comparison.edits("next.success and next.reward")
    for one in sessions:
        first = one.first_episode
        here = {name: values[first : first + one.size] for name, values in rows.items()}
        if len(here["action"]) != one.size:
            raise ValueError(f"first_episode of session {one.ulid} is {first}")
        _compare(comparison, one, here)
    return comparison.edits("next.success and next.reward")


def _compare(comparison: Comparison, recorded: Recorded, rows: _Columns) -> None:
    first, columns = recorded.first_episode, recorded.columns
    places = [f"episode {first + number}" for number in range(recorded.size)]
    outcome, actions = columns["attempts/outcome"], columns["attempts/pregrasp_x_y_angle"]
    taken, poses = columns["attempts/picture_taken"], columns["overhead/pose_base_tool"]
    ids = session_ids(recorded.ulid, recorded.size)
    for name in _LABELS:
        comparison.labels(name, rows[name].astype(np.float64), outcome=outcome, ids=ids, places=places)
    known = {"action": np.isfinite(actions).all(axis=1), "observation.state": taken[:, VIEWPOINTS.index("overhead")]}
    stored = {"action": actions, "observation.state": _states(poses, known["observation.state"])}
    for name, rows_known in known.items():
        # What stands in for something unknown means nothing.
        found, expected = (np.where(rows_known[:, None], one, 0) for one in (rows[name], stored[name]))
        with np.errstate(over="ignore"):  # A number that 32 bits do not hold is another one, and no more is said of it.
            comparison.same(name, found.astype(np.float32), expected.astype(np.float32), places)
    episodes = np.arange(first, first + recorded.size)
    numbers = {"episode_index": episodes, "index": episodes}
    for name in _PLACES:
        comparison.same(name, rows[name], numbers.get(name, np.zeros_like(episodes)), places)


def _states(poses: NDArray[np.float64], taken: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Tool poses on the plane, as states hold them; zeros where there is no picture. Shape (N, 3)."""
    states = np.zeros((len(poses), 3))
    for at in np.flatnonzero(taken):
        pose = PlanarPose.from_pose_base_tool(poses[at])
        states[at] = (pose.x_m, pose.y_m, pose.angle_rad)
    return states


def _rows(path: Path) -> _Columns:
    """The small columns of all data files, in the order of the files. Missing numbers are NaN."""
    tables = []
    for file in sorted(path.glob("data/*/[!.]*.parquet")):
        try:
            tables.append(pq.read_table(file, columns=list(_COLUMNS)).cast(_schema()))
        except (OSError, KeyError, ValueError, pa.ArrowException) as error:
            raise CorruptDataError(
                f"attempts cannot be read from {file}: {headline(error)}; take an undamaged copy"
            ) from error
    table = pa.concat_tables(tables) if tables else _schema().empty_table()
    return {
        name: np.array(table[name].to_pylist(), np.float64).reshape(len(table), *((3,) if width > 1 else ()))
        for name, width in ((field.name, 3 if pa.types.is_fixed_size_list(field.type) else 1) for field in _schema())
    }


def _schema() -> pa.Schema:
    triple = pa.list_(pa.float32(), 3)
    numbers = dict.fromkeys(_COLUMNS, pa.float64()) | {"action": triple, "observation.state": triple}
    return pa.schema(list(numbers.items()))
