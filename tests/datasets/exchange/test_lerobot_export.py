"""What LeRobot reads of an export: no nulls, depth with its unit, statistics. ``.ci/peers`` asks LeRobot itself."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from tests.support.factories import difference, make_attempt, make_header, record

from handsight.datasets import (
    GraspDataset,
    GraspRepository,
    InterchangeError,
    Outcome,
    RgbdFrame,
    export_dataset,
    import_dataset,
)
from handsight.datasets.exchange.pictures import decoded

VIEWPOINTS = ("overhead", "pregrasp")
MEASURES = {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}


def exported(dataset: GraspDataset, path: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The features, and the rows of the first data file."""
    export_dataset(dataset, path, format="lerobot")
    info = json.loads((path / "meta/info.json").read_text())
    return info["features"], pq.read_table(path / info["data_path"].format(chunk_index=0, file_index=0)).to_pylist()


def recorded(folder: Path, attempts: int = 12, *, pregrasp: bool = True, **station: Any) -> GraspDataset:
    """A dataset, with the pre-grasp pictures or without."""
    repository = GraspRepository.create(folder)
    header = make_header(seed=3, **station)
    made = [make_attempt(header, number) for number in range(attempts)]
    kept = made if pregrasp else [replace(one, pregrasp=None) for one in made]
    record(repository, header, kept)
    return GraspDataset.open(str(folder))


def test_the_files_are_those_that_lerobot_reads(dataset: GraspDataset, tmp_path: Path) -> None:
    """One episode of one frame for each attempt, all of its columns declared, and no others."""
    features, rows = exported(dataset, tmp_path / "out")
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert (info["codebase_version"], info["total_episodes"], info["total_frames"]) == ("v3.0", 24, 24)
    assert set(rows[0]) == set(features)
    episodes = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pydict()
    assert episodes["dataset_from_index"] == episodes["episode_index"] == [row["episode_index"] for row in rows]
    assert pd.read_parquet(tmp_path / "out/meta/tasks.parquet").iloc[0].name == "grasp"
    for identity, row in zip(dataset.attempts.index, rows, strict=True):
        assert row["next.success"] == (dataset.attempt(identity).outcome is Outcome.HELD)


def test_what_an_attempt_lacks_is_stood_in_for_and_marked(dataset: GraspDataset, tmp_path: Path) -> None:
    features, rows = exported(dataset, tmp_path / "out")
    assert {"valid.overhead", "valid.pregrasp", "valid.action"} <= set(features)
    for identity, row in zip(dataset.attempts.index, rows, strict=True):
        attempt = dataset.attempt(identity)
        assert all(value is not None for value in row.values())
        assert np.isfinite([*row["observation.state"], *row["action"]]).all()
        assert row["valid.action"] == np.isfinite(attempt.pregrasp_x_m)
        for viewpoint in VIEWPOINTS:
            frame: RgbdFrame | None = getattr(attempt, viewpoint)
            rgb = decoded(row[f"observation.images.{viewpoint}"]["bytes"])
            depth = decoded(row[f"observation.depth.{viewpoint}"]["bytes"])
            assert row[f"valid.{viewpoint}"] == (frame is not None)
            np.testing.assert_array_equal(rgb, np.zeros((6, 8, 3), np.uint8) if frame is None else frame.rgb)
            np.testing.assert_array_equal(depth, np.zeros((6, 8)) if frame is None else frame.depth)


def test_what_no_attempt_has_is_left_out(tmp_path: Path) -> None:
    features, _ = exported(recorded(tmp_path / "grasps", pregrasp=False), tmp_path / "out")
    assert not [name for name in features if "pregrasp" in name]
    assert "observation.images.overhead" in features


def test_what_every_attempt_has_takes_no_flag(tmp_path: Path) -> None:
    repository = GraspRepository.create(tmp_path / "grasps")
    header = make_header()
    record(repository, header, [make_attempt(header, number, outcome=Outcome.HELD) for number in range(3)])
    features, _ = exported(GraspDataset.open(str(tmp_path / "grasps")), tmp_path / "out")
    assert not [name for name in features if name.startswith("valid.")]


@pytest.mark.parametrize("depth_scale_m", [1e-3, 2.5e-4, 1e-4, 0.00012345])
def test_depth_is_in_millimetres_whatever_the_camera_counts_in(tmp_path: Path, depth_scale_m: float) -> None:
    dataset = recorded(tmp_path / "grasps", depth_scale_m=depth_scale_m)
    features, rows = exported(dataset, tmp_path / "out")
    for viewpoint in VIEWPOINTS:
        feature = features[f"observation.depth.{viewpoint}"]
        assert feature["info"] == {"is_depth_map": True, "depth_unit": "mm"}
        assert (feature["dtype"], feature["shape"]) == ("image", [6, 8, 1])
    for identity, row in zip(dataset.attempts.index, rows, strict=True):
        attempt = dataset.attempt(identity)
        if attempt.overhead is not None:
            depth_mm = decoded(row["observation.depth.overhead"]["bytes"])
            np.testing.assert_allclose(depth_mm, attempt.overhead.depth * depth_scale_m * 1e3, rtol=1e-6)
    import_dataset(tmp_path / "out", tmp_path / "back")
    back = GraspDataset.open(str(tmp_path / "back"))
    assert back.digest == dataset.digest
    for identity in dataset.attempts.index:
        assert difference(back.attempt(identity), dataset.attempt(identity)) is None


def test_everything_has_statistics_of_what_is_there(dataset: GraspDataset, tmp_path: Path) -> None:
    features, rows = exported(dataset, tmp_path / "out")
    statistics = json.loads((tmp_path / "out/meta/stats.json").read_text())
    assert statistics.keys() == features.keys()
    for name, feature in features.items():
        found = {measure: np.array(value) for measure, value in statistics[name].items()}
        assert found.keys() == MEASURES
        image = feature["dtype"] == "image"
        shape = (feature["shape"][2], 1, 1) if image else (feature["shape"][0],)
        assert {value.shape for measure, value in found.items() if measure != "count"} == {shape}
        flag = {"action": "valid.action", "observation.state": "valid.overhead"}.get(name)
        flag = f"valid.{name.rpartition('.')[2]}" if image else flag
        known = [row[name] for row in rows if flag is None or row[flag]]
        values = np.array([decoded(one["bytes"]) for one in known] if image else known, np.float64)
        values = values.reshape(-1, shape[0]) / (255 if "images" in name else 1)
        assert found["count"].tolist() == [len(known)]
        for measure in ("min", "max", "mean", "std"):
            expected = getattr(values, measure)(axis=0)
            np.testing.assert_allclose(found[measure].ravel(), expected, rtol=1e-5, atol=1e-12, err_msg=name)
        for measure in MEASURES - {"min", "max", "mean", "std", "count"}:
            share = int(measure[1:]) / 100
            expected = np.quantile(values, share, axis=0, method="inverted_cdf" if image else "linear")
            np.testing.assert_allclose(found[measure].ravel(), expected, rtol=1e-5, atol=1e-12, err_msg=name)


def test_every_episode_has_statistics_of_its_row(dataset: GraspDataset, tmp_path: Path) -> None:
    features, rows = exported(dataset, tmp_path / "out")
    episodes = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    for name, feature in features.items():
        for row, episode in zip(rows, episodes, strict=True):
            found = {measure: np.array(episode[f"stats/{name}/{measure}"]) for measure in MEASURES}
            assert found["count"].tolist() == [1]
            if feature["dtype"] == "image":
                pixels = decoded(row[name]["bytes"]).reshape(-1, feature["shape"][2]).astype(np.float64)
                pixels /= 255 if "images" in name else 1
                assert found["mean"].shape == (feature["shape"][2], 1, 1)
                np.testing.assert_allclose(found["mean"].ravel(), pixels.mean(axis=0), rtol=1e-5)
                np.testing.assert_allclose(found["std"].ravel(), pixels.std(axis=0), rtol=1e-5, atol=1e-9)
            else:
                np.testing.assert_allclose(found["q50"], np.atleast_1d(row[name]), rtol=1e-5)
                assert not found["std"].any()


def test_pictures_of_two_sizes_make_no_lerobot_dataset(tmp_path: Path) -> None:
    repository = GraspRepository.create(tmp_path / "grasps")
    for width in (8, 10):
        header = make_header(seed=width, width=width)
        record(repository, header, [make_attempt(header, 0)])
    with pytest.raises(InterchangeError, match=r"pictures are 8x6 in session \w+, 10x6 in session .* hdf5 or zarr"):
        export_dataset(GraspDataset.open(str(tmp_path / "grasps")), tmp_path / "out", format="lerobot")
    assert not (tmp_path / "out").exists()
