"""LeRobotDataset v3.0: one episode of one frame for each attempt, pictures as PNG inside the Parquet files.

::

    meta/info.json, meta/tasks.parquet, meta/stats.json, meta/episodes/chunk-000/file-000.parquet
    data/chunk-000/file-<k>.parquet       one row for each attempt:
        observation.images.<viewpoint>         RGB, PNG; null where the picture was never taken
        observation.images.<viewpoint>_depth   16-bit PNG in units of the camera's depth scale, every bit kept
        observation.state                 f4 (3,), tool pose of the overhead picture: x [m], y [m], angle [rad]
        action                            f4 (3,), pre-grasp x [m], y [m], angle [rad] in the base frame
        next.reward, next.success, timestamp, frame_index, episode_index, index, task_index
    meta/handsight/origin.json            what LeRobot has no place for: versions, curation,
    meta/handsight/<ulid>.json, .npz      and of every session its attributes and columns, as in schema.py

LeRobot's own video encoding would quantise depth; pictures in Parquet do not. What lies in ``meta/handsight`` is what
brings every byte back; LeRobot does not read it.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from handsight.datasets.errors import CorruptDataError, InterchangeError
from handsight.datasets.exchange.bundle import (
    Bundle,
    decisions_from_json,
    decisions_to_json,
    origin_of,
    refuse_changed,
    refuse_linked,
    schema_of_origin,
)
from handsight.datasets.exchange.lerobot_edits import edits_of
from handsight.datasets.exchange.parquet_rows import RowReader
from handsight.datasets.exchange.sources import SessionSource, checked_source, stored_sources
from handsight.datasets.format.arrays import array_at, group_at, read_rows
from handsight.datasets.format.rows import frame_of, from_row
from handsight.datasets.format.schema import COLUMNS, SESSIONS, VIEWPOINTS, Viewpoint, attempt_id, column_widths
from handsight.datasets.format.upgrades import columns_since, current_attributes, empty_columns
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import GraspAttempt, RgbdFrame
from handsight.datasets.writing.batches import column_paths
from handsight.servoing.planar import PlanarPose

_VERSION = "v3.0"
_FPS = 1
_TASK = "grasp"
_EPISODES_PER_FILE = 256
"""About 250 MB of pictures in one data file."""
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES = "meta/episodes/chunk-000/file-000.parquet"
_SIDE = "meta/handsight"
_PICTURE = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
_INTEGERS = ("frame_index", "episode_index", "index", "task_index")


def recognises(path: Path) -> bool:
    """Whether the path is a folder with a LeRobotDataset."""
    return path.is_dir() and (path / "meta" / "info.json").is_file()


def write(dataset: GraspDataset, path: Path, on_attempt: Callable[[], None]) -> None:
    """Write a version to a new folder."""
    root = dataset.root
    sources = stored_sources(root)
    for folder in (_SIDE, Path(_EPISODES).parent, "data/chunk-000"):
        (path / folder).mkdir(parents=True)
    first = 0
    for source in sources:
        group = group_at(root, f"{SESSIONS}/{source.ulid}")
        columns = {name: read_rows(array_at(group, name), 0, source.size) for name in column_paths()}
        with zipfile.ZipFile(path / _SIDE / f"{source.ulid}.npz", "x", zipfile.ZIP_DEFLATED) as file:
            for name, values in columns.items():
                with file.open(f"{_flat_name(name)}.npy", "w", force_zip64=True) as entry:
                    np.lib.format.write_array(entry, values, allow_pickle=False)
        described = {"attributes": source.attributes, "first_episode": first}
        (path / _SIDE / f"{source.ulid}.json").write_text(json.dumps(described))
        first += source.size
    statistics = _write_frames(path, sources, on_attempt)
    _write_meta(path, sources, first, statistics)
    origin = {**origin_of(dataset), "decisions": decisions_to_json(dataset.overlay.decisions)}
    (path / _SIDE / "origin.json").write_text(json.dumps(origin))


@contextmanager
def open_bundle(path: Path) -> Iterator[Bundle]:
    """Open a folder for import. Only what handsight exported holds what an attempt needs.

    Raises:
        InterchangeError: The folder was not exported by handsight, is newer, or holds links.
    """
    refuse_linked(path)
    try:
        origin = json.loads((path / _SIDE / "origin.json").read_text())
        schema = schema_of_origin(origin, path)
        files = [file for file in (path / _SIDE).glob("*.npz") if not file.name.startswith("._")]  # Of macOS.
        ulids = sorted(file.stem for file in files)
        sessions = [_source(path, ulid, schema) for ulid in ulids]
        refuse_changed(origin, sessions, path)
        decisions = decisions_from_json(origin["decisions"], path)
        edits = edits_of(path, sessions)
    except (InterchangeError, CorruptDataError):
        raise
    except (OSError, KeyError, ValueError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise InterchangeError(
            f"{path} lacks what handsight exports beside LeRobot's own files ({type(error).__name__}: {error}): "
            "a LeRobotDataset of another origin holds no calibrated attempts"
        ) from error
    yield Bundle(sessions=sessions, decisions=decisions, edits=edits)


def _write_frames(
    path: Path, sources: list[SessionSource], on_attempt: Callable[[], None]
) -> dict[str, list[NDArray[np.float64]]]:
    """Write the data files; returns the numbers of every attempt, for the statistics."""
    numbers: dict[str, list[NDArray[np.float64]]] = {"observation.state": [], "action": [], "next.reward": []}
    episode, writer = 0, None
    try:
        for source in sources:
            for attempt in source.attempts():
                if episode % _EPISODES_PER_FILE == 0:
                    if writer is not None:
                        writer.close()
                    writer = pq.ParquetWriter(path / _file_of(episode), _schema(), compression="none")
                assert writer is not None
                row = _frame(attempt, episode)
                writer.write_table(pa.Table.from_pylist([row], schema=_schema()))
                for name, values in numbers.items():
                    values.append(np.atleast_1d(np.asarray(row[name], np.float64)))
                episode += 1
                on_attempt()
        if writer is None:
            writer = pq.ParquetWriter(path / _file_of(0), _schema(), compression="none")
    finally:
        if writer is not None:
            writer.close()
    return numbers


def _frame(attempt: GraspAttempt, episode: int) -> dict[str, Any]:
    pictures: dict[str, Any] = {}
    for viewpoint in VIEWPOINTS:
        frame = frame_of(attempt, viewpoint)
        rgb = None if frame is None else cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2BGR)
        pictures[f"observation.images.{viewpoint}"] = _png(rgb)
        pictures[f"observation.images.{viewpoint}_depth"] = _png(None if frame is None else frame.depth)
    state = (float("nan"),) * 3
    if attempt.overhead is not None:
        pose = PlanarPose.from_pose_base_tool(attempt.overhead.pose_base_tool)
        state = (pose.x_m, pose.y_m, pose.angle_rad)
    return {
        **pictures,
        "observation.state": state,
        "action": (attempt.pregrasp_x_m, attempt.pregrasp_y_m, attempt.pregrasp_angle_rad),
        "next.reward": float(attempt.success),
        "next.success": attempt.success,
        "timestamp": 0.0,
        "frame_index": 0,
        "episode_index": episode,
        "index": episode,
        "task_index": 0,
    }


def _schema() -> pa.Schema:
    images = [
        (f"observation.images.{viewpoint}{kind}", _PICTURE) for viewpoint in VIEWPOINTS for kind in ("", "_depth")
    ]
    triple = pa.list_(pa.float32(), 3)
    numbers = [("observation.state", triple), ("action", triple), ("next.reward", pa.float32())]
    rest = [("next.success", pa.bool_()), ("timestamp", pa.float32()), *((name, pa.int64()) for name in _INTEGERS)]
    return pa.schema([*images, *numbers, *rest])


def _write_meta(
    path: Path, sources: list[SessionSource], episodes: int, numbers: dict[str, list[NDArray[np.float64]]]
) -> None:
    index = list(range(episodes))
    table = {
        "episode_index": index,
        "tasks": [[_TASK]] * episodes,
        "length": [1] * episodes,
        "dataset_from_index": index,
        "dataset_to_index": [one + 1 for one in index],
        "data/chunk_index": [0] * episodes,
        "data/file_index": [one // _EPISODES_PER_FILE for one in index],
        "meta/episodes/chunk_index": [0] * episodes,
        "meta/episodes/file_index": [0] * episodes,
    }
    pq.write_table(pa.table(table), path / _EPISODES)
    pd.DataFrame({"task_index": [0]}, index=pd.Index([_TASK])).to_parquet(path / "meta/tasks.parquet")
    statistics = {name: _statistics(np.array(values)) for name, values in numbers.items() if values}
    (path / "meta/stats.json").write_text(json.dumps(statistics))
    info = {
        "codebase_version": _VERSION,
        "robot_type": sources[0].header.station.source if sources else None,
        "total_episodes": episodes,
        "total_frames": episodes,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 500,
        "video_files_size_in_mb": 500,
        "fps": _FPS,
        "splits": {"train": f"0:{episodes}"},
        "data_path": _DATA,
        "video_path": None,
        "features": _features(sources),
    }
    (path / "meta/info.json").write_text(json.dumps(info, indent=4))


def _features(sources: list[SessionSource]) -> dict[str, Any]:
    """LeRobot's description of the columns; pictures have the size of the first session's."""
    size = (480, 640)
    if sources:
        intrinsics = sources[0].header.station.camera.intrinsics
        size = (intrinsics.height, intrinsics.width)
    axes = ["height", "width", "channels"]
    pose = {"dtype": "float32", "shape": [3], "names": ["x_m", "y_m", "angle_rad"]}
    images = {
        f"observation.images.{viewpoint}{kind}": {"dtype": "image", "shape": [*size, channels], "names": axes}
        for viewpoint in VIEWPOINTS
        for kind, channels in (("", 3), ("_depth", 1))
    }
    return {
        **images,
        "observation.state": pose,
        "action": pose,
        "next.reward": {"dtype": "float32", "shape": [1], "names": None},
        "next.success": {"dtype": "bool", "shape": [1], "names": None},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
        **{name: {"dtype": "int64", "shape": [1], "names": None} for name in _INTEGERS},
    }


def _statistics(values: NDArray[np.float64]) -> dict[str, list[float]]:
    """Over the attempts for which every value is known. ``values`` has shape (N, K)."""
    known = values[np.isfinite(values).all(axis=1)]
    if not len(known):
        known = np.zeros((1, values.shape[1]))
    measures = {name: getattr(known, name)(axis=0).tolist() for name in ("min", "max", "mean", "std")}
    return {**measures, "count": [len(known)]}


def _source(path: Path, ulid: str, schema: int) -> SessionSource:
    described = json.loads((path / _SIDE / f"{ulid}.json").read_text())
    attributes = current_attributes(described["attributes"], schema)
    added = {f"attempts/{column.name}" for column in columns_since(schema)}
    with np.load(path / _SIDE / f"{ulid}.npz", allow_pickle=False) as file:
        columns = {name: file[_flat_name(name)] for name in column_paths() if name not in added}
    size = len(columns["attempts/number"])
    source = checked_source(ulid, attributes, size=size)
    widths = column_widths(source.header)
    columns |= {f"attempts/{name}": values for name, values in empty_columns(schema, size, widths).items()}
    for column in COLUMNS:
        found = columns[f"attempts/{column.name}"]
        if found.dtype != np.dtype(column.dtype) or found.shape != (size, *column.shape(widths)):
            raise InterchangeError(f"{path}: column {column.name} of session {ulid} is {found.dtype} {found.shape}")
    for viewpoint in VIEWPOINTS:
        if columns[f"{viewpoint}/pose_base_tool"].shape != (size, 4, 4):
            raise InterchangeError(f"{path}: the poses of {viewpoint} of session {ulid} have another shape")
    return replace(
        source,
        attempts=partial(_read_attempts, path, ulid, columns, int(described["first_episode"])),
        digests=tuple(digest.tobytes() for digest in columns["attempts/digest"]),
    )


def _read_attempts(path: Path, ulid: str, columns: dict[str, NDArray[Any]], first: int) -> Iterator[GraspAttempt]:
    file, opened = None, ""
    for number in range(len(columns["attempts/number"])):
        episode = first + number
        name = _file_of(episode)
        try:
            if name != opened:
                file, opened = RowReader(path / name), name
            assert file is not None
            row = file.row(episode % _EPISODES_PER_FILE)
            pictures = {viewpoint: _rgbd_frame(row, viewpoint, columns, number) for viewpoint in VIEWPOINTS}
        except (OSError, KeyError, ValueError, IndexError, TypeError, cv2.error, pa.ArrowException) as error:
            raise CorruptDataError(
                f"attempt {attempt_id(ulid, number)} cannot be read from {path / name}: {error}; take an undamaged copy"
            ) from error
        values = {column.name: columns[f"attempts/{column.name}"][number] for column in COLUMNS}
        yield from_row(values, pictures)


def _rgbd_frame(
    row: dict[str, Any], viewpoint: Viewpoint, columns: dict[str, NDArray[Any]], number: int
) -> RgbdFrame | None:
    if not columns["attempts/picture_taken"][number, VIEWPOINTS.index(viewpoint)]:
        return None
    bgr, depth = (_decoded(row[f"observation.images.{viewpoint}{kind}"]["bytes"]) for kind in ("", "_depth"))
    pose = columns[f"{viewpoint}/pose_base_tool"][number]
    return RgbdFrame(rgb=np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)), depth=depth, pose_base_tool=pose)


def _png(picture: NDArray[Any] | None) -> dict[str, Any] | None:
    return None if picture is None else {"bytes": cv2.imencode(".png", picture)[1].tobytes(), "path": None}


def _decoded(data: bytes) -> NDArray[Any]:
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise ValueError("a picture cannot be decoded")
    return np.asarray(picture)


def _file_of(episode: int) -> str:
    return _DATA.format(chunk_index=0, file_index=episode // _EPISODES_PER_FILE)


def _flat_name(path: str) -> str:
    return path.replace("/", ".")
