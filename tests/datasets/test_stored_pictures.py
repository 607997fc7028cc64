"""Pictures come back bit for bit, whatever their size and content, and reading them needs nothing of handsight."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zarr
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray
from tests.datasets.factories import make_attempt, make_header, record

from handsight.datasets import GraspRepository, Outcome
from handsight.datasets.schema import create_frames

SIDES = st.integers(1, 9)

READER = """
import hashlib, sys
import icechunk, zarr
repository = icechunk.Repository.open(icechunk.local_filesystem_storage(sys.argv[1]))
root = zarr.open_group(repository.readonly_session("main").store, mode="r")
(session,) = root["sessions"].groups()
view = session[1]["overhead"]
print()
print(hashlib.sha256(view["rgb"][:].tobytes() + view["depth"][:].tobytes()).hexdigest(), "handsight" in sys.modules)
"""


def stored(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """What an array of pictures of this size gives back."""
    group = zarr.open_group(zarr.storage.MemoryStore(), mode="w")
    create_frames(group, "pictures", dtype=values.dtype.name, frame=values.shape[1:])
    array = group["pictures"]
    assert isinstance(array, zarr.Array)
    array.resize(values.shape)
    array[:] = values
    return np.asarray(array[:])


@given(st.data(), SIDES, SIDES)
def test_every_picture_of_every_size_comes_back(data: st.DataObject, height: int, width: int) -> None:
    rgb = data.draw(arrays.arrays(np.uint8, (2, height, width, 3)))
    depth = data.draw(arrays.arrays(np.uint16, (2, height, width)))
    np.testing.assert_array_equal(stored(rgb), rgb)
    np.testing.assert_array_equal(stored(depth), depth)


@pytest.mark.parametrize("value", [0, 1, 255])
def test_flat_pictures_come_back(value: int) -> None:
    rgb = np.full((1, 480, 640, 3), value, np.uint8)
    np.testing.assert_array_equal(stored(rgb), rgb)


def test_icechunk_and_zarr_read_a_dataset_without_handsight(tmp_path: Path) -> None:
    header = make_header(width=64, height=48)
    attempt = make_attempt(header, 0, outcome=Outcome.HELD)
    record(GraspRepository.create(tmp_path / "grasps"), header, [attempt])
    assert attempt.overhead is not None
    expected = hashlib.sha256(attempt.overhead.rgb.tobytes() + attempt.overhead.depth.tobytes()).hexdigest()
    command = [sys.executable, "-W", "ignore", "-c", READER, str(tmp_path / "grasps")]
    printed = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path).stdout
    # Icechunk warns on the same stream that folders are not for production.
    assert printed.splitlines()[-1].split() == [expected, "False"]
