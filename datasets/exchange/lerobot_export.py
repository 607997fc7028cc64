"""Export as a LeRobotDataset; ``lerobot_layout`` says what it looks like."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from handsight.datasets.errors import InterchangeError
from handsight.datasets.exchange.bundle import decisions_to_json, origin_of
from handsight.datasets.exchange.lerobot_layout import (
    DATA,
    EPISODES,
    EPISODES_PER_FILE,
    INTEGERS,
    PICTURE,
    SIDE,
    TASK,
    VERSION,
    data_file,
    depth_key,
    flat_name,
    rgb_key,
    valid_key,
)
from handsight.datasets.exchange.lerobot_rows import POSE, RowMaker
from handsight.datasets.exchange.lerobot_statistics import Statistics, episode_columns
from handsight.datasets.exchange.sources import SessionSource, stored_sources
from handsight.datasets.format.arrays import array_at, group_at, read_range
from handsight.datasets.format.schema import SESSIONS, VIEWPOINTS, Viewpoint
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.writing.batches import column_paths

_FPS = 1
_AXES = ["height", "width", "channels"]

Columns = dict[str, NDArray[Any]]
"""Of a session: everything of its attempts but the pictures."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Contents:
    """What the rows of an export have, known before the first is written."""

    size: tuple[int, int]
    """Height and width of every picture."""
    viewpoints: tuple[Viewpoint, ...]
    """Those from which some attempt has a picture."""
    flags: tuple[str, ...]
    """What some row lacks, and some other has: a viewpoint, or ``action``."""


def write(dataset: GraspDataset, path: Path, on_attempt: Callable[[], None]) -> None:
    """Write a version to a new folder.

    Raises:
        InterchangeError: Its sessions have pictures of different sizes, which LeRobot cannot batch.
    """
    root = dataset.root
    sources = stored_sources(root)
    size = _common_size(sources)
    for folder in (SIDE, Path(EPISODES).parent, "data/chunk-000"):
        (path / folder).mkdir(parents=True)
    has: dict[str, list[NDArray[np.bool_]]] = {}
    first = 0
    for source in sources:
        group = group_at(root, f"{SESSIONS}/{source.ulid}")
        columns = {name: read_range(array_at(group, name), 0, source.size) for name in column_paths()}
        _write_session(path / SIDE, source, columns, first_episode=first)
        for what, present in _present(columns).items():
            has.setdefault(what, []).append(present)
        first += source.size
    contents = _contents(size, {what: np.concatenate(parts) for what, parts in has.items()})
    features = _features(contents)
    rows = RowMaker(features, size=size, viewpoints=contents.viewpoints, flags=contents.flags)
    _write_rows(path, sources, rows, _schema(features), on_attempt)
    _write_meta(path, sources, first, features, rows.statistics)
    origin = {**origin_of(dataset), "decisions": decisions_to_json(dataset.overlay.decisions)}
    (path / SIDE / "origin.json").write_text(json.dumps(origin))


def _common_size(sources: Sequence[SessionSource]) -> tuple[int, int]:
    sizes: dict[tuple[int, int], str] = {}
    for source in sources:
        intrinsics = source.header.station.camera.intrinsics
        sizes.setdefault((intrinsics.height, intrinsics.width), source.ulid)
    if len(sizes) > 1:
        found = ", ".join(f"{width}x{height} in session {ulid}" for (height, width), ulid in sizes.items())
        raise InterchangeError(
            f"pictures are {found}, and a LeRobotDataset has one size: export to hdf5 or zarr, or a version with one"
        )
    return next(iter(sizes), (480, 640))


def _write_session(folder: Path, source: SessionSource, columns: Columns, *, first_episode: int) -> None:
    with zipfile.ZipFile(folder / f"{source.ulid}.npz", "x", zipfile.ZIP_DEFLATED) as file:
        for name, values in columns.items():
            with file.open(f"{flat_name(name)}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, values, allow_pickle=False)
    described = {"attributes": source.attributes, "first_episode": first_episode}
    (folder / f"{source.ulid}.json").write_text(json.dumps(described))


def _present(columns: Columns) -> dict[str, NDArray[np.bool_]]:
    """Which attempts of a session have what a row may lack. Each of shape (N,)."""
    taken = dict(zip(VIEWPOINTS, columns["attempts/picture_taken"].T, strict=True))
    action = np.isfinite(columns["attempts/pregrasp_x_y_angle"]).all(axis=1)
    return {**taken, "action": action}


def _contents(size: tuple[int, int], has: dict[str, NDArray[np.bool_]]) -> _Contents:
    shown = tuple(viewpoint for viewpoint in VIEWPOINTS if viewpoint in has and has[viewpoint].any())
    said = [what for what in has if what in shown or what not in VIEWPOINTS]
    return _Contents(size=size, viewpoints=shown, flags=tuple(what for what in said if not has[what].all()))


def _features(contents: _Contents) -> dict[str, dict[str, Any]]:
    """LeRobot's description of the columns."""
    number = {"shape": [1], "names": None}
    pose = {"dtype": "float32", "shape": [len(POSE)], "names": list(POSE)}
    features: dict[str, dict[str, Any]] = {}
    for viewpoint in contents.viewpoints:
        image = {"dtype": "image", "names": _AXES}
        features[rgb_key(viewpoint)] = {**image, "shape": [*contents.size, 3]}
        depth = {"is_depth_map": True, "depth_unit": "mm"}
        features[depth_key(viewpoint)] = {**image, "shape": [*contents.size, 1], "info": depth}
    features |= {"observation.state": pose, "action": pose}
    features |= {valid_key(what): {"dtype": "bool", **number} for what in contents.flags}
    features |= {"next.reward": {"dtype": "float32", **number}, "next.success": {"dtype": "bool", **number}}
    features |= {"timestamp": {"dtype": "float32", **number}}
    return features | {name: {"dtype": "int64", **number} for name in INTEGERS}


def _schema(features: dict[str, dict[str, Any]]) -> pa.Schema:
    scalars = {"float32": pa.float32(), "bool": pa.bool_(), "int64": pa.int64(), "image": PICTURE}
    fields = []
    for name, feature in features.items():
        scalar, (width, *_) = scalars[feature["dtype"]], feature["shape"]
        vector = feature["dtype"] != "image" and width > 1
        fields.append((name, pa.list_(scalar, width) if vector else scalar))
    return pa.schema(fields)


def _write_rows(
    path: Path, sources: Sequence[SessionSource], rows: RowMaker, schema: pa.Schema, on_attempt: Callable[[], None]
) -> None:
    """Write the data files."""
    episode = 0
    writer = pq.ParquetWriter(path / data_file(0), schema, compression="none")
    try:
        for source in sources:
            for attempt in source.attempts():
                if episode and episode % EPISODES_PER_FILE == 0:
                    writer.close()
                    writer = pq.ParquetWriter(path / data_file(episode), schema, compression="none")
                row = rows.row(attempt, episode, source.header.station.depth_scale_m)
                writer.write_table(pa.Table.from_pylist([row], schema=schema))
                episode += 1
                on_attempt()
    finally:
        writer.close()


def _write_meta(
    path: Path,
    sources: Sequence[SessionSource],
    episodes: int,
    features: dict[str, dict[str, Any]],
    statistics: Statistics,
) -> None:
    index = list(range(episodes))
    table = {
        "episode_index": index,
        "tasks": [[TASK]] * episodes,
        "length": [1] * episodes,
        "dataset_from_index": index,
        "dataset_to_index": [one + 1 for one in index],
        "data/chunk_index": [0] * episodes,
        "data/file_index": [one // EPISODES_PER_FILE for one in index],
        "meta/episodes/chunk_index": [0] * episodes,
        "meta/episodes/file_index": [0] * episodes,
        **(episode_columns(statistics) if episodes else {}),
    }
    pq.write_table(pa.table(table), path / EPISODES)
    pd.DataFrame({"task_index": [0]}, index=pd.Index([TASK])).to_parquet(path / "meta/tasks.parquet")
    overall = {name: feature.overall() for name, feature in statistics.items()} if episodes else {}
    (path / "meta/stats.json").write_text(json.dumps(overall))
    info = {
        "codebase_version": VERSION,
        "robot_type": sources[0].header.station.source if sources else None,
        "total_episodes": episodes,
        "total_frames": episodes,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 500,
        "video_files_size_in_mb": 500,
        "fps": _FPS,
        "splits": {"train": f"0:{episodes}"},
        "data_path": DATA,
        "video_path": None,
        "features": features,
    }
    (path / "meta/info.json").write_text(json.dumps(info, indent=4))
