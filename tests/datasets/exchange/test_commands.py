"""What goes out in another format comes back whole, and what is not sound never gets in."""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import zarr
from tests.support.factories import difference, make_attempt, make_header, record

from handsight.datasets import (
    EXPORT_FORMATS,
    CorruptDataError,
    DatasetError,
    GraspDataset,
    GraspRepository,
    InterchangeError,
    MergeError,
    Outcome,
    export_dataset,
    import_dataset,
)
from handsight.datasets.curation.curator import Curator
from handsight.datasets.reading.selection import Selection


@pytest.fixture
def dataset(repository: GraspRepository) -> GraspDataset:
    """Two sessions, one of them of a rig, with curation."""
    for header, size in ((make_header(seed=1), 21), (make_header(seed=None, source="ur10", serials=None), 3)):
        record(repository, header, [make_attempt(header, number) for number in range(size)], every=5)
    curator = Curator(repository, author="jo")
    held, empty = (Selection(where=f"outcome == '{outcome}'") for outcome in ("held", "empty"))
    curator.exclude(held, "blurred")
    curator.undo()
    curator.exclude(empty, "dark")
    curator.relabel(held, False, "slipped")
    return GraspDataset.open(str(repository.path))


def snapshot_of_folder(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_a_round_trip_keeps_every_byte(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    seen = []
    export_dataset(dataset, tmp_path / "out", format=name, on_attempt=lambda: seen.append(1))
    report = import_dataset(tmp_path / "out", tmp_path / "back")
    assert (report.format, report.created, report.transfer.attempts, len(seen)) == (name, True, 24, 24)
    back = GraspDataset.open(f"{tmp_path}/back")
    assert back.digest == dataset.digest
    assert back.curation_digest == dataset.curation_digest
    assert back.sessions == dataset.sessions
    assert back.overlay.decisions == dataset.overlay.decisions
    assert back.attempts.equals(dataset.attempts)
    for identity in dataset.attempts.index:
        assert difference(back.attempt(identity), dataset.attempt(identity)) is None
    assert sorted(path.name for path in tmp_path.iterdir()) == ["back", "grasps", "out"]


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_an_empty_dataset_makes_the_round_trip(repository: GraspRepository, tmp_path: Path, name: str) -> None:
    export_dataset(GraspDataset(repository, ref="main"), tmp_path / "out", format=name)
    assert import_dataset(tmp_path / "out", tmp_path / "back").transfer.attempts == 0
    assert GraspDataset.open(f"{tmp_path}/back").attempts.empty


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_importing_again_adds_nothing(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    export_dataset(dataset, tmp_path / "out", format=name)
    before = dataset.repository.resolve("main")
    report = import_dataset(tmp_path / "out", dataset.repository.path)
    assert not report.created
    assert report.transfer.sessions == ()
    assert report.transfer.duplicates == tuple(session.ulid for session in dataset.sessions)
    assert dataset.repository.resolve("main") == before


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_a_dry_run_changes_nothing(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    export_dataset(dataset, tmp_path / "out", format=name)
    report = import_dataset(tmp_path / "out", tmp_path / "back", dry_run=True)
    assert (report.created, report.transfer.attempts, report.transfer.snapshot) == (False, 24, None)
    assert not (tmp_path / "back").exists()


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_an_export_never_overwrites_and_a_failed_one_leaves_nothing(
    dataset: GraspDataset, tmp_path: Path, name: str
) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(InterchangeError, match="something at"):
        export_dataset(dataset, tmp_path / "out", format=name)
    assert (tmp_path / "out").read_text() == "mine"

    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_dataset(dataset, tmp_path / "new" / "out", format=name, on_attempt=stop)
    assert list((tmp_path / "new").iterdir()) == []


def test_formats_are_named_and_told_apart(dataset: GraspDataset, tmp_path: Path) -> None:
    with pytest.raises(InterchangeError, match="'csv', expected one of hdf5, zarr, lerobot, images"):
        export_dataset(dataset, tmp_path / "out", format="csv")
    with pytest.raises(InterchangeError, match="there is nothing at"):
        import_dataset(tmp_path / "nowhere", tmp_path / "back")
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(InterchangeError, match="in no known format"):
        import_dataset(tmp_path / "notes.txt", tmp_path / "back")
    assert not (tmp_path / "back").exists()


def test_hdf5_reads_as_robomimic_does(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out.hdf5", format="hdf5")
    with h5py.File(tmp_path / "out.hdf5") as file:
        assert json.loads(file["data"].attrs["env_args"]).keys() == {"env_name", "type", "env_kwargs"}
        assert file["data"].attrs["total"] == len(file["data"]) == 24
        labelled = {name.decode() for name in file["mask/labelled"]}
        excluded = {name.decode() for name in file["mask/excluded"]}
        for name, demo in file["data"].items():
            row = dataset.attempts.loc[demo.attrs["attempt"]]
            assert demo.attrs["num_samples"] == 1
            assert (name in labelled) == (row["outcome"] in ("held", "empty"))
            assert (name in excluded) == row["excluded"]
            assert demo["rewards"][0] == float(row["outcome"] == "held")
            assert {len(demo["obs"][key]) for key in demo["obs"]} <= {1}
            if row["overhead_taken"]:
                expected = dataset.frame(demo.attrs["attempt"], "overhead")
                np.testing.assert_array_equal(demo["obs/overhead_rgb"][0], expected.rgb)
                np.testing.assert_array_equal(demo["obs/overhead_depth"][0], expected.depth)
                assert demo["obs/overhead_depth"].compression == "gzip"


def test_plain_zarr_opens_with_zarr_alone(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out.zarr", format="zarr")
    root = zarr.open_group(str(tmp_path / "out.zarr"), mode="r")
    attributes: dict[str, Any] = root.attrs.asdict()
    origin = attributes["handsight"]
    assert (origin["digest"], origin["snapshot"]) == (dataset.digest, dataset.snapshot_id)
    identity = dataset.attempts.index[dataset.attempts["overhead_taken"]][-1]
    session, _, number = identity.rpartition("-")
    array = root[f"sessions/{session}/overhead/rgb"]
    assert isinstance(array, zarr.Array)
    np.testing.assert_array_equal(array[int(number)], dataset.frame(identity).rgb)


def edited_hdf5(edit: Callable[[h5py.File], object]) -> Callable[[Path], None]:
    def apply(path: Path) -> None:
        with h5py.File(path, "r+") as file:
            edit(file)

    return apply


def _replace(file: h5py.File, name: str, value: object) -> None:
    del file[name]
    file[name] = value


def _edit_attributes(file: h5py.File, edit: Callable[[dict[str, Any]], object]) -> None:
    ulid = min(file["sessions"])
    attributes = json.loads(file[f"sessions/{ulid}/attributes"].asstr()[()])
    edit(attributes)
    _replace(file, f"sessions/{ulid}/attributes", json.dumps(attributes))


def _change_pixel(file: h5py.File) -> None:
    frames = [demo["obs/overhead_rgb"] for demo in file["data"].values() if "overhead_rgb" in demo["obs"]]
    frames[0][0, 0, 0, 0] ^= 1


def _claim_rows(file: h5py.File) -> None:
    name = f"sessions/{min(file['sessions'])}/columns/number"
    del file[name]
    file.create_dataset(name, shape=(10**12,), dtype="int64", chunks=(1024,), compression="gzip")


def _claim_pixels(card: dict[str, Any]) -> None:
    card["header"]["station"]["camera"]["intrinsics"].update(width=10**6, height=10**6)


BAD_HDF5: dict[str, tuple[Callable[[Path], object], str]] = {
    "truncated": (lambda path: os.truncate(path, path.stat().st_size // 2), "cannot be opened as HDF5"),
    "foreign": (edited_hdf5(lambda file: file.attrs.pop("handsight")), "schema version None"),
    "newer": (edited_hdf5(lambda file: file.attrs.modify("handsight", '{"schema_version": 99}')), "version 99"),
    "not JSON": (edited_hdf5(lambda file: file.attrs.modify("handsight", "{")), "not exported by handsight"),
    "external link": (
        edited_hdf5(lambda file: file["data"].__setitem__("x", h5py.ExternalLink("/etc/passwd", "/"))),
        "holds a link at /data/x",
    ),
    "soft link": (
        edited_hdf5(lambda file: file["data"].__setitem__("x", h5py.SoftLink("/sessions"))),
        "holds a link at /data/x",
    ),
    "external storage": (
        edited_hdf5(lambda file: file.create_dataset("x", (1,), "u1", external=[("/etc/passwd", 0, 1)])),
        "in other files",
    ),
    "no sessions": (edited_hdf5(lambda file: file.__delitem__("sessions")), "no group sessions"),
    "session name": (
        edited_hdf5(lambda file: file.move(f"sessions/{min(file['sessions'])}", "sessions/up")),
        "session 'up' was not written",
    ),
    "column": (
        edited_hdf5(lambda file: _replace(file, f"sessions/{min(file['sessions'])}/columns/outcome", [1])),
        "columns/outcome is int64",
    ),
    "header": (
        edited_hdf5(lambda file: _edit_attributes(file, lambda card: card.pop("header"))),
        "KeyError: 'header'",
    ),
    "changed header": (
        edited_hdf5(lambda file: _edit_attributes(file, lambda card: card.update(config_digest="0" * 64))),
        "config_digest does not belong",
    ),
    "status": (
        edited_hdf5(lambda file: _edit_attributes(file, lambda card: card.update(status="lost"))),
        "status is 'lost'",
    ),
    "a bomb of rows": (edited_hdf5(_claim_rows), "claims 1000000000000 attempts"),
    "a bomb of pixels": (edited_hdf5(lambda file: _edit_attributes(file, _claim_pixels)), "at most 8192 pixels a side"),
    "decisions": (edited_hdf5(lambda file: _replace(file, "decisions", '[{"action": "burn"}]')), "decisions in"),
    "a pixel": (edited_hdf5(_change_pixel), "not what its recorded digest says"),
    "a missing demo": (edited_hdf5(lambda file: file.__delitem__("data/demo_20")), "cannot be read from"),
    "swapped demos": (
        edited_hdf5(lambda file: file["data/demo_20"].attrs.modify("attempt", "another")),
        "demo_20 is attempt another",
    ),
}


@pytest.mark.parametrize("name", BAD_HDF5)
def test_a_bad_file_is_refused_and_leaves_nothing(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    damage, message = BAD_HDF5[name]
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    damage(tmp_path / "out")
    target = GraspRepository.create(tmp_path / "target")
    before = target.resolve("main")
    for place in ("new", "target"):
        with pytest.raises((InterchangeError, CorruptDataError), match=message):
            import_dataset(tmp_path / "out", tmp_path / place)
    assert not (tmp_path / "new").exists()
    assert target.resolve("main") == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["grasps", "out", "target"]


def _link_out(path: Path) -> None:
    (path / "sessions" / "link").symlink_to("/etc")


def _flip_chunk(path: Path) -> None:
    chunk = max(path.glob("sessions/*/overhead/rgb/c/*/0/0/0"), key=lambda one: one.stat().st_size)
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 4
    chunk.write_bytes(data)


def _newer(path: Path) -> None:
    zarr.open_group(str(path), mode="r+").update_attributes({"handsight": {"schema_version": 99}})


def _claim_zarr_rows(path: Path) -> None:
    for name in ("number", "digest"):
        array = zarr.open_array(str(next(path.glob(f"sessions/*/attempts/{name}"))), mode="r+")
        array.resize((10**12, *array.shape[1:]))


def _foreign(path: Path) -> None:
    shutil.rmtree(path)
    zarr.create_group(str(path))


BAD_ZARR: dict[str, tuple[Callable[[Path], object], str]] = {
    "link": (_link_out, "holds a link at"),
    "bit": (_flip_chunk, "is damaged in row"),
    "newer": (_newer, "schema version 99"),
    "foreign": (_foreign, "schema version None"),
    "a bomb of rows": (_claim_zarr_rows, "claims 1000000000000 attempts"),
    "root": (lambda path: (path / "zarr.json").write_text("{"), "no readable group"),
    "missing array": (
        lambda path: shutil.rmtree(next(path.glob("sessions/*/attempts/outcome"))),
        "attempts/outcome cannot be read",
    ),
}


@pytest.mark.parametrize("name", BAD_ZARR)
def test_a_bad_folder_is_refused_and_leaves_nothing(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    damage, message = BAD_ZARR[name]
    export_dataset(dataset, tmp_path / "out", format="zarr")
    damage(tmp_path / "out")
    with pytest.raises(DatasetError, match=message):
        import_dataset(tmp_path / "out", tmp_path / "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["grasps", "out"]


def test_a_session_of_other_instruments_is_refused_unless_allowed(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    other = GraspRepository.create(tmp_path / "other")
    header = make_header(seed=9, depth_scale_m=2e-3, gripper_stroke_m=0.14)
    record(other, header, [make_attempt(header, 0, outcome=Outcome.HELD)])
    with pytest.raises(MergeError, match=r"depth_scale_m 0.001, the dataset 0.002.*gripper_stroke_m 0.085, the"):
        import_dataset(tmp_path / "out", tmp_path / "other")
    assert len(GraspDataset.open(f"{tmp_path}/other").attempts) == 1
    import_dataset(tmp_path / "out", tmp_path / "other", allow_mismatch=True)
    assert len(GraspDataset.open(f"{tmp_path}/other").attempts) == 25


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
