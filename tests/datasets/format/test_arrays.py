"""Every array ends in a checksum, so that damage is found and named."""

from __future__ import annotations

from itertools import chain, repeat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from tests.support.factories import make_attempt, make_header, record
from zarr.codecs import Crc32cCodec, TransposeCodec

from handsight.datasets import VIEWPOINTS, CorruptDataError, GraspDataset, GraspRepository, Outcome, RgbdFrame
from handsight.datasets.format.arrays import PIXELS, group_at, read_rows

HEADER = make_header()


@pytest.fixture
def dataset(repository: GraspRepository) -> GraspDataset:
    """Two sessions, 24 and 3 attempts of every outcome."""
    for seed, size in ((1, 24), (2, 3)):
        header = make_header(seed=seed)
        record(repository, header, [make_attempt(header, number) for number in range(size)], every=5)
    return GraspDataset.open(str(repository.path))


def test_every_array_ends_its_codecs_with_a_checksum(dataset: GraspDataset) -> None:
    root = dataset.repository.root(dataset.snapshot_id)
    arrays = [node for _, node in root.members(max_depth=None) if isinstance(node, zarr.Array)]
    assert len(arrays) == 2 * 24
    for array in arrays:
        assert isinstance(array.compressors[-1], Crc32cCodec)


def damage_bit(path: Path, rng: np.random.Generator) -> None:
    data = bytearray(path.read_bytes())
    data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)


def damage_length(path: Path, rng: np.random.Generator) -> None:
    path.write_bytes(path.read_bytes()[: rng.integers(path.stat().st_size)])


def damage_existence(path: Path, rng: np.random.Generator) -> None:
    path.unlink()


@pytest.mark.parametrize("damage", [damage_bit, damage_length, damage_existence])
def test_damage_to_any_picture_is_found_and_its_attempt_named(repository: GraspRepository, damage: Any) -> None:
    header = make_header(width=64, height=48)
    attempts = [make_attempt(header, number, outcome=Outcome.HELD) for number in range(3)]
    record(repository, header, attempts)
    whole: dict[str, dict[str, RgbdFrame]] = {
        viewpoint: dict(GraspDataset.open(str(repository.path)).frames(viewpoint)) for viewpoint in VIEWPOINTS
    }
    pictures = [chunk for chunk in (repository.folder / "chunks").iterdir() if chunk.stat().st_size > 4000]
    assert len(pictures) == 3 * 2 * 2
    rng = np.random.default_rng(0)
    named = []
    for chunk in pictures:
        kept = chunk.read_bytes()
        damage(chunk, rng)
        dataset = GraspDataset.open(str(repository.path))
        with pytest.raises(CorruptDataError, match="is damaged in row") as caught:
            list(chain.from_iterable(dataset.frames(viewpoint) for viewpoint in VIEWPOINTS))
        named.append(next(identity for identity in dataset.attempts.index if identity in str(caught.value)))
        chunk.write_bytes(kept)
    assert {identity: named.count(identity) for identity in named} == dict.fromkeys(whole["overhead"], 4)


def test_damage_to_a_column_is_found(repository: GraspRepository) -> None:
    record(repository, HEADER, [make_attempt(HEADER, number) for number in range(200)], every=200)
    columns = list((repository.folder / "chunks").iterdir())
    assert len(columns) >= 5
    rng = np.random.default_rng(0)
    for chunk in columns:
        kept = chunk.read_bytes()
        damage_bit(chunk, rng)
        dataset = GraspDataset.open(str(repository.path))
        session = dataset.repository.root(dataset.snapshot_id)[f"sessions/{dataset.sessions[0].ulid}"]
        assert isinstance(session, zarr.Group)
        groups = [group_at(session, name) for name in (*VIEWPOINTS, "attempts")]
        arrays = [array for group in groups for name, array in group.arrays() if name not in ("rgb", "depth")]
        with pytest.raises(CorruptDataError, match="is damaged in rows 0 to 199"):
            list(map(read_rows, arrays, repeat(0), repeat(200)))
        chunk.write_bytes(kept)
    GraspDataset.open(str(repository.path)).info()


SIDES = st.integers(1, 9)
TRANSPOSED = (TransposeCodec(order=(0, 1, 3, 2)),)


@given(st.data(), SIDES, SIDES)
def test_pictures_are_read_alike_with_and_without_the_copy_by_colour(
    data: st.DataObject, height: int, width: int
) -> None:
    rgb = data.draw(arrays.arrays(np.uint8, (3, height, width, 3)))
    array = zarr.create_array(zarr.storage.MemoryStore(), data=rgb, chunks=(1, height, width, 3), filters=TRANSPOSED)
    first = data.draw(st.integers(0, 2))
    rows = read_rows(array, first, 3)
    assert rows.dtype == rgb.dtype
    np.testing.assert_array_equal(rows, rgb[first:])
    np.testing.assert_array_equal(rows, array[first:])
    chosen = array.get_orthogonal_selection((np.array([0, 2]),), prototype=PIXELS)
    np.testing.assert_array_equal(np.asarray(chosen), rgb[[0, 2]])
