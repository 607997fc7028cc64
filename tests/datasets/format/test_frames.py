"""Pictures come back bit for bit, whatever their size and content, and reading them needs nothing of handsight."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zarr
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray
from tests.support.factories import make_attempt, make_header, record
from zarr.codecs import Crc32cCodec

from handsight.datasets import GraspDataset, GraspRepository, Outcome, SessionWriter
from handsight.datasets.format import schema
from handsight.datasets.format.schema import create_depth, create_rgb
from handsight.datasets.integrity.verify import verify

SIDES = st.integers(1, 9)
READER = """
import hashlib, sys
import icechunk, zarr
repository = icechunk.Repository.open(icechunk.local_filesystem_storage(sys.argv[1]))
root = zarr.open_group(repository.readonly_session("main").store, mode="r")
(session,) = root["sessions"].groups()
taken = session[1]["overhead"]
print()
print(hashlib.sha256(taken["rgb"][:].tobytes() + taken["depth"][:].tobytes()).hexdigest(), "handsight" in sys.modules)
"""


def stored(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """What an array of pictures of this size gives back."""
    group = zarr.open_group(zarr.storage.MemoryStore(), mode="w")
    create = create_rgb if values.ndim == 4 else create_depth
    create(group, "pictures", frame=values.shape[1:3])
    array = group["pictures"]
    assert isinstance(array, zarr.Array)
    array.resize(values.shape)
    array[:] = values
    return np.asarray(array[:])


def create_plain(dtype: str, *colours: int) -> Callable[..., None]:
    """Arrays of pictures as another version of handsight may have made them."""

    def create(group: zarr.Group, name: str, *, frame: tuple[int, int]) -> None:
        shape = (*frame, *colours)
        group.create_array(name, shape=(0, *shape), chunks=(1, *shape), dtype=dtype, compressors=Crc32cCodec())

    return create


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


def test_a_session_goes_on_as_it_began_whatever_the_codecs_are_today(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    header = make_header(width=64, height=48)
    repository = GraspRepository.create(tmp_path / "grasps")
    attempts = [make_attempt(header, number, outcome=Outcome.HELD) for number in range(3)]
    with monkeypatch.context() as patch:
        # Known arrays are neither looked up nor remembered.
        patch.setattr(schema, "_blank", schema._blank.__wrapped__)
        patch.setattr(schema, "create_rgb", create_plain("uint8", 3))
        patch.setattr(schema, "create_depth", create_plain("uint16"))
        with SessionWriter.begin(repository, header) as writer:
            writer.append(attempts[0])
    for number in (1, 2):
        with SessionWriter.resume(repository, header) as writer:
            writer.append(attempts[number])
    dataset = GraspDataset.open(str(repository.path))
    report = verify(dataset)
    assert (report.checked, report.ok) == (3, True)
    for number, attempt in enumerate(attempts):
        assert attempt.overhead is not None
        found = dataset.attempt(f"{writer.session}-{number:06d}").overhead
        assert found is not None
        np.testing.assert_array_equal(found.rgb, attempt.overhead.rgb)
        np.testing.assert_array_equal(found.depth, attempt.overhead.depth)
