"""LeRobotDataset v3.0, and folders that are refused."""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from handsight.datasets import CorruptDataError, GraspDataset, InterchangeError, Outcome, export_dataset, import_dataset


def test_lerobot_finds_what_it_reads(dataset: GraspDataset, tmp_path: Path) -> None:
    """The files and columns that LeRobotDataset v3.0 reads, one episode of one frame for each attempt."""
    export_dataset(dataset, tmp_path / "out", format="lerobot")
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert (info["codebase_version"], info["total_episodes"], info["total_frames"]) == ("v3.0", 24, 24)
    file = info["data_path"].format(chunk_index=0, file_index=0)
    rows = pq.read_table(tmp_path / "out" / file)
    assert set(rows.column_names) == set(info["features"])
    episodes = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pydict()
    assert episodes["dataset_from_index"] == episodes["episode_index"] == rows["episode_index"].to_pylist()
    assert pd.read_parquet(tmp_path / "out/meta/tasks.parquet").iloc[0].name == "grasp"
    for identity, row in zip(dataset.attempts.index, rows.to_pylist(), strict=True):
        attempt = dataset.attempt(identity)
        assert row["next.success"] == (attempt.outcome is Outcome.HELD)
        assert (row["observation.images.overhead"] is None) == (attempt.overhead is None)
        if attempt.overhead is not None:
            depth = cv2.imdecode(np.frombuffer(row["observation.images.overhead_depth"]["bytes"], np.uint8), -1)
            np.testing.assert_array_equal(depth, attempt.overhead.depth)
    assert json.loads((tmp_path / "out/meta/stats.json").read_text())["action"]["count"] == [
        int(dataset.attempts["pregrasp_x_m"].notna().sum())
    ]


def _foreign_lerobot(path: Path) -> None:
    shutil.rmtree(path / "meta/handsight")


def _truncate_data(path: Path) -> None:
    file = path / "data/chunk-000/file-000.parquet"
    os.truncate(file, file.stat().st_size // 2)


def _pickle_column(path: Path) -> None:
    file = next((path / "meta/handsight").glob("*.npz"))
    with zipfile.ZipFile(file, "w") as archive, archive.open("attempts.number.npy", "w") as entry:
        np.lib.format.write_array(entry, np.array([{}], dtype=object), allow_pickle=True)


def _climb(path: Path) -> None:
    file = next((path / "meta/handsight").glob("*.npz"))
    file.rename(file.with_name("..npz"))


BAD_LEROBOT: dict[str, tuple[Callable[[Path], None], str]] = {
    "foreign": (_foreign_lerobot, "lacks what handsight exports"),
    "truncated": (_truncate_data, "cannot be read from"),
    "pickle": (_pickle_column, "lacks what handsight exports"),
    "session name": (_climb, "lacks what handsight exports"),
    "link": (lambda path: (path / "data/x").symlink_to("/"), "holds a link at"),
}


@pytest.mark.parametrize("name", BAD_LEROBOT)
def test_a_bad_lerobot_folder_is_refused_and_leaves_nothing(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    damage, message = BAD_LEROBOT[name]
    export_dataset(dataset, tmp_path / "out", format="lerobot")
    damage(tmp_path / "out")
    with pytest.raises((InterchangeError, CorruptDataError), match=message):
        import_dataset(tmp_path / "out", tmp_path / "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["grasps", "out"]
