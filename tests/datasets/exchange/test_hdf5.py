"""HDF5 as robomimic reads it, and files that are refused."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from handsight.datasets import (
    CorruptDataError,
    GraspDataset,
    GraspRepository,
    InterchangeError,
    StorageError,
    export_dataset,
    import_dataset,
)
from handsight.datasets.exchange import hdf5


def test_hdf5_reads_as_robomimic_does(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out.hdf5", format="hdf5")
    with h5py.File(tmp_path / "out.hdf5") as file:
        assert json.loads(file["data"].attrs["env_args"]).keys() == {"env_name", "type", "env_kwargs"}
        assert file["data"].attrs["total"] == len(file["data"])
        assert len(file["data"]) + len(file["unlabelled"]) == 24
        labelled = {name.decode() for name in file["mask/labelled"]}
        excluded = {name.decode() for name in file["mask/excluded"]}
        assert labelled == set(file["data"])
        for name, demo in (*file["data"].items(), *file["unlabelled"].items()):
            row = dataset.attempts.loc[demo.attrs["attempt"]]
            assert demo.attrs["num_samples"] == 1
            assert (name in labelled) == (row["outcome"] in ("held", "empty"))
            assert (name in excluded) == (row["excluded"] and name in labelled)
            assert demo["rewards"][0] == float(row["outcome"] == "held")
            assert {len(demo["obs"][key]) for key in demo["obs"]} <= {1}
            if row["overhead_taken"]:
                expected = dataset.frame(demo.attrs["attempt"], "overhead")
                np.testing.assert_array_equal(demo["obs/overhead_rgb"][0], expected.rgb)
                np.testing.assert_array_equal(demo["obs/overhead_depth"][0], expected.depth)
                assert demo["obs/overhead_depth"].compression == "gzip"


def test_robomimic_needs_no_filter_key(dataset: GraspDataset, tmp_path: Path) -> None:
    """It reads every demo of data, and wants the same observations of each."""
    export_dataset(dataset, tmp_path / "out.hdf5", format="hdf5")
    with h5py.File(tmp_path / "out.hdf5") as file:
        assert len(file["unlabelled"]) > 0
        assert all({"overhead_rgb", "overhead_depth"} <= set(demo["obs"]) for demo in file["data"].values())


def test_an_older_export_with_all_demos_in_data_comes_back(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out.hdf5", format="hdf5")
    with h5py.File(tmp_path / "out.hdf5", "r+") as file:
        for name in list(file["unlabelled"]):
            file.move(f"unlabelled/{name}", f"data/{name}")
        del file["unlabelled"]
        file["data"].attrs["total"] = len(file["data"])
    report = import_dataset(tmp_path / "out.hdf5", tmp_path / "back").transfer
    back = GraspDataset.open(str(tmp_path / "back"))
    assert (report.attempts, back.digest, report.edits) == (24, dataset.digest, ())


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


def _claim_text(file: h5py.File) -> None:
    del file["decisions"]
    file.create_dataset("decisions", shape=(10**9,), dtype=h5py.string_dtype(), chunks=(1024,))


def _branch(file: h5py.File) -> None:
    """Two ways from every group to the next: few bytes, and more paths than can be walked."""
    group = file
    for _ in range(40):
        below = group.create_group("left")
        group["right"] = below
        group = below


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
    "two names": (edited_hdf5(lambda file: file["data"].__setitem__("x", file["data"])), "under another name too"),
    "endless paths": (edited_hdf5(_branch), "under another name too"),
    "no object": (edited_hdf5(lambda file: file.attrs.modify("handsight", "[]")), "schema version None"),
    "a bomb of text": (edited_hdf5(_claim_text), "decisions is no text"),
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
        "header is missing",
    ),
    "changed header": (
        edited_hdf5(lambda file: _edit_attributes(file, lambda card: card.update(config_digest="0" * 64))),
        "config_digest does not belong",
    ),
    "seed": (
        edited_hdf5(lambda file: _edit_attributes(file, lambda card: card["header"].update(seed=99))),
        "header, .* are not as recorded",
    ),
    "status": (
        edited_hdf5(lambda file: _edit_attributes(file, lambda card: card.update(status="lost"))),
        "status is 'lost'",
    ),
    "a bomb of rows": (edited_hdf5(_claim_rows), "claims 1000000000000 attempts"),
    "a bomb of pixels": (
        edited_hdf5(lambda file: _edit_attributes(file, _claim_pixels)),
        "camera.intrinsics.width is 1000000 px, expected 1 to 8192 px",
    ),
    "decisions": (edited_hdf5(lambda file: _replace(file, "decisions", '[{"action": "burn"}]')), "decisions in"),
    "a pixel": (edited_hdf5(_change_pixel), "not what its recorded digest says"),
    "a missing demo": (edited_hdf5(lambda file: file.__delitem__("data/demo_20")), r"demos are missing \(demo_20\)"),
    "swapped demos": (
        edited_hdf5(lambda file: file["data/demo_20"].attrs.modify("attempt", "another")),
        r"attempt names another attempt \(demo_20\)",
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


def test_a_file_that_is_open_for_writing_elsewhere_says_so(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    # Another process: within one, the library shares what is open.
    writer = "import h5py, sys; file = h5py.File(sys.argv[1], 'r+'); print('open', flush=True); sys.stdin.read()"
    words = [sys.executable, "-P", "-c", writer, str(tmp_path / "out")]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"open\n"
        with pytest.raises(InterchangeError, match="is open for writing in another program"):
            import_dataset(tmp_path / "out", tmp_path / "new")
        other.communicate()
    import_dataset(tmp_path / "out", tmp_path / "new")


def test_a_file_that_cannot_be_read_is_not_called_damaged(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    number = resource.getrlimit(resource.RLIMIT_NOFILE)
    held: list[int] = []
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, number[1]))
    try:
        with contextlib.suppress(OSError):
            while True:
                held.append(os.open(tmp_path / "out", os.O_RDONLY))
        with pytest.raises(StorageError, match="Too many open files; nothing is known of its content"):
            hdf5.open_bundle(tmp_path / "out").__enter__()
    finally:
        for descriptor in held:
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, number)
