"""LeRobot's folders of both layouts, and what their own description may not make an import do."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from tests.support.foreign_sets import LEROBOT_MAP, unpack_lerobot, write_map

from handsight.datasets import InterchangeError, import_dataset
from handsight.datasets.exchange.mapped.lerobot_set import open_set


def as_v21(folder: Path) -> Path:
    """The same set in the layout before 3.0: a file for each episode, and what is said of them in lines of JSON."""
    edit_info(folder, lambda info: info.update(codebase_version="v2.1"))
    data = folder / "data/chunk-000/file-000.parquet"
    table = pq.read_table(data)
    data.unlink()
    for number in range(5):
        rows = table.filter(pc.field("episode_index") == number)
        pq.write_table(rows, folder / f"data/chunk-000/episode_{number:06d}.parquet")
    lines = [json.dumps({"episode_index": number, "length": 4, "grade": float(number == 3)}) for number in range(5)]
    (folder / "meta/episodes.jsonl").write_text("\n".join(lines))
    return folder


def edit_info(folder: Path, edit: Callable[[dict[str, Any]], object]) -> None:
    info = json.loads((folder / "meta/info.json").read_text())
    edit(info)
    (folder / "meta/info.json").write_text(json.dumps(info))


def test_both_layouts_hold_the_same(tmp_path: Path) -> None:
    unpack_lerobot(tmp_path / "new")
    as_v21(unpack_lerobot(tmp_path / "old"))
    with open_set(tmp_path / "new") as new, open_set(tmp_path / "old") as old:
        assert list(old.names) == list(new.names) == [f"episode {number}" for number in range(5)]
        for episode in range(5):
            for column in ("observation.state", "next.success"):
                np.testing.assert_array_equal(old.values(episode, column), new.values(episode, column))
            picture = "observation.images.wrist"
            np.testing.assert_array_equal(old.picture(episode, picture, 3), new.picture(episode, picture, 3))


def test_a_label_may_be_said_of_the_episode(tmp_path: Path) -> None:
    path = write_map(tmp_path / "map.toml", LEROBOT_MAP, label={"column": "grade"})
    report = import_dataset(as_v21(unpack_lerobot(tmp_path / "set")), tmp_path / "new", map=path, dry_run=True)
    assert report.preview is not None
    assert (report.preview["held"], report.preview["empty"]) == (1, 4)


BAD: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "a newer version": (lambda info: info.update(codebase_version="v4.0"), "'v4.0', expected v2.0, v2.1, v3.0"),
    "a video elsewhere": (lambda info: info.update(video_path="../../{video_key}.mp4"), "is not in the folder"),
    "no such video": (lambda info: info.update(video_path="videos/{video_key}.mp4"), "there is no video"),
    "a strange template": (lambda info: info.update(video_path="{none}"), "where the video .* lies is not said"),
    "features": (lambda info: info.update(features=[]), "features is list, expected an object"),
    "depth as video": (
        lambda info: info["features"]["observation.images.wrist"].update(info={"is_depth_map": True}),
        "is depth encoded as video, which is lossy",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_description_is_refused(tmp_path: Path, name: str) -> None:
    edit, said = BAD[name]
    edit_info(unpack_lerobot(tmp_path / "set", "video"), edit)
    path = write_map(tmp_path / "map.toml", LEROBOT_MAP)
    with pytest.raises(InterchangeError, match=said):
        import_dataset(tmp_path / "set", tmp_path / "new", map=path)


def test_a_video_that_cannot_be_decoded_is_named_with_its_codec(tmp_path: Path) -> None:
    video = next(unpack_lerobot(tmp_path / "set", "video").rglob("*.mp4"))
    video.write_bytes(b"no video at all")
    with pytest.raises(InterchangeError, match=r"\(codec av1\) cannot be decoded: encode it as H.264"):
        import_dataset(tmp_path / "set", tmp_path / "new", map=write_map(tmp_path / "map.toml", LEROBOT_MAP))
