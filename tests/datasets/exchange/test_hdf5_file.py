"""HDF5 files on disks that fail. Whatever else happens, the process lives: the library crashes when it cannot write."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from tests.support.small_disk import files_of_at_most

from handsight.datasets.exchange.hdf5_file import new_hdf5_file


def fill(path: Path) -> None:
    with new_hdf5_file(path) as new:
        for number in range(40):
            group = new.root.create_group(f"group_{number}")
            group.attrs["number"] = number
            noise = np.random.default_rng(number).integers(0, 256, (20, 50), dtype=np.uint8)
            group.create_dataset("noise", data=noise, chunks=(10, 50), compression="gzip")
            new.check()


def test_what_is_written_is_what_h5py_reads(tmp_path: Path) -> None:
    fill(tmp_path / "new.hdf5")
    with h5py.File(tmp_path / "new.hdf5") as file:
        for number in range(40):
            noise = np.random.default_rng(number).integers(0, 256, (20, 50), dtype=np.uint8)
            np.testing.assert_array_equal(file[f"group_{number}/noise"], noise)


@pytest.mark.parametrize("size", [0, 1, 100, 2048, 5000, 10_000, 30_000, 50_000, 60_000])
def test_a_disk_that_fails_at_any_place_is_an_error(tmp_path: Path, size: int) -> None:
    fill(tmp_path / "whole.hdf5")
    assert (tmp_path / "whole.hdf5").stat().st_size > size
    with files_of_at_most(size), pytest.raises(OSError, match="too large"):
        fill(tmp_path / "new.hdf5")
    assert (tmp_path / "new.hdf5").stat().st_size <= size


def test_it_never_overwrites(tmp_path: Path) -> None:
    (tmp_path / "new.hdf5").write_text("mine")
    with pytest.raises(FileExistsError):
        fill(tmp_path / "new.hdf5")
    assert (tmp_path / "new.hdf5").read_text() == "mine"
