"""Demos of an HDF5 file: in their order, without following links, without believing what they claim."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from tests.support.foreign_sets import HDF5_MAP, write_hdf5, write_map

from handsight.datasets import InterchangeError, import_dataset
from handsight.datasets.exchange.mapped.hdf5_set import open_set


def test_demos_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    with open_set(write_hdf5(tmp_path / "demos.hdf5", demos=11)) as demos:
        assert demos.names == [f"demo_{number}" for number in range(11)]
        assert demos.values(0, "@success").tolist() == [True]
        assert demos.values(0, "obs/eef").shape == (3, 7)
        assert demos.picture(0, "obs/wrist_depth", 2).shape == (6, 8, 1)


def _claim(file: h5py.File) -> None:
    del file["data/demo_0/obs/eef"]
    file.create_dataset("data/demo_0/obs/eef", shape=(10**12, 7), dtype="f8", chunks=(1024, 7), compression="gzip")


def _relink(link: Any) -> Callable[[h5py.File], None]:
    def apply(file: h5py.File) -> None:
        del file["data/demo_0/obs/eef"]
        file["data/demo_0/obs/eef"] = link

    return apply


BAD: dict[str, tuple[Callable[[h5py.File], object], str]] = {
    "a bomb of rows": (_claim, "claims shape"),
    "an external link": (_relink(h5py.ExternalLink("/etc/passwd", "/")), "is a link: links are not followed"),
    "a soft link": (_relink(h5py.SoftLink("/data/demo_1/obs/eef")), "is a link: links are not followed"),
    "no demos": (lambda file: file.__delitem__("data"), "has no demos"),
    "no column": (lambda file: file.__delitem__("data/demo_0/obs/eef"), "obs/eef is not in demo_0, which has"),
    "none in a later demo": (lambda file: file.__delitem__("data/demo_2/rewards"), "demo_2: rewards is not in demo_2"),
    "text for a pose": (_relink(np.array([b"x"] * 3)), "expected frames of 7 numbers"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused(tmp_path: Path, name: str) -> None:
    damage, said = BAD[name]
    with h5py.File(write_hdf5(tmp_path / "demos.hdf5"), "r+") as file:
        damage(file)
    with pytest.raises(InterchangeError, match=said):
        import_dataset(tmp_path / "demos.hdf5", tmp_path / "new", map=write_map(tmp_path / "map.toml", HDF5_MAP))
    assert not (tmp_path / "new").exists()


def test_a_label_may_be_an_attribute(tmp_path: Path) -> None:
    changed = write_map(tmp_path / "map.toml", HDF5_MAP, label={"column": "@success", "frame": None, "success": True})
    report = import_dataset(write_hdf5(tmp_path / "demos.hdf5"), tmp_path / "new", map=changed, dry_run=True)
    assert report.preview is not None
    assert (report.preview["held"], report.preview["empty"]) == (2, 1)
