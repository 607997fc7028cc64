"""What the user of a LeRobot export changed in the columns that LeRobot reads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from handsight.datasets.errors import CorruptDataError, counted, headline
from handsight.datasets.exchange.edits import Comparison, Edits, session_ids
from handsight.datasets.exchange.lerobot_layout import SIDE, flat_name
from handsight.datasets.exchange.sources import SessionSource
from handsight.datasets.format.schema import VIEWPOINTS
from handsight.servoing.planar import PlanarPose

_LABELS = ("next.success", "next.reward")
_PLACES = ("episode_index", "index", "frame_index", "task_index")
_COLUMNS = (*_LABELS, "action", "observation.state", *_PLACES)

_Columns = dict[str, NDArray[np.generic]]


def edits_of(path: Path, sources: Sequence[SessionSource]) -> Edits:
    """Compare the rows of the data files with the columns of their sessions.

    Args:
        path: The export, whose columns have been checked.
        sources: Its sessions.

    Raises:
        InterchangeError: Something was changed that no decision can hold; the message lists it.
        CorruptDataError: A data file is damaged.
        KeyError, TypeError, ValueError, OSError: What lies beside the data files is damaged.
    """
    comparison = Comparison(path.name)
    rows = _rows(path)
    found, expected = len(rows["episode_index"]), sum(source.size for source in sources)
    if found != expected:
        comparison.refuse(f"there are {counted(found, 'row')} of {counted(expected, 'attempt')}", ["data"])
        return comparison.edits("next.success and next.reward")
    for source in sources:
        first = int(json.loads((path / SIDE / f"{source.ulid}.json").read_text())["first_episode"])
        here = {name: values[first : first + source.size] for name, values in rows.items()}
        if source.size and (first < 0 or len(here["action"]) != source.size):
            raise ValueError(f"first_episode of session {source.ulid} is {first}")
        _compare(comparison, path, source, here, first)
    return comparison.edits("next.success and next.reward")


def _compare(comparison: Comparison, path: Path, source: SessionSource, rows: _Columns, first: int) -> None:
    places = [f"episode {first + number}" for number in range(source.size)]
    with np.load(path / SIDE / f"{source.ulid}.npz", allow_pickle=False) as file:
        outcome, actions, taken, poses = (
            file[flat_name(name)]
            for name in (
                "attempts/outcome",
                "attempts/pregrasp_x_y_angle",
                "attempts/picture_taken",
                "overhead/pose_base_tool",
            )
        )
    ids = session_ids(source.ulid, source.size)
    for name in _LABELS:
        comparison.labels(name, rows[name].astype(np.float64), outcome=outcome, ids=ids, places=places)
    known = {"action": np.isfinite(actions).all(axis=1), "observation.state": taken[:, VIEWPOINTS.index("overhead")]}
    recorded = {"action": actions, "observation.state": _states(poses, known["observation.state"])}
    for name, rows_known in known.items():
        # What stands in for something unknown means nothing.
        found, expected = (np.where(rows_known[:, None], one, 0) for one in (rows[name], recorded[name]))
        comparison.same(name, found.astype(np.float32), expected.astype(np.float32), places)
    episodes = np.arange(first, first + source.size)
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
