"""Cached arrays: what was written for a purpose is read for it, and nothing else is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from handsight.datasets.inputs.cache import open_cache, write_cache

SHAPE = (5, 4, 3, 3)


def values(shape: tuple[int, ...] = SHAPE) -> NDArray[np.float16]:
    return np.arange(np.prod(shape)).reshape(shape).astype(np.float16)


def write(path: Path, *, holds: str = "inputs of v1", shape: tuple[int, ...] = SHAPE) -> None:
    def fill(array: NDArray[Any]) -> None:
        array[:] = values(shape)

    write_cache(path, holds=holds, shape=shape, dtype=np.float16, fill=fill)


def read(path: Path, *, holds: str = "inputs of v1") -> NDArray[Any] | None:
    return open_cache(path, holds=holds, shape=SHAPE, dtype=np.float16)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cache") / "inputs.npy"
    write(path)
    return path


def test_what_was_written_is_mapped_and_any_program_can_read_it(path: Path) -> None:
    array = read(path)
    assert isinstance(array, np.memmap)
    np.testing.assert_array_equal(array, values())
    np.testing.assert_array_equal(np.load(path), values())
    assert list(path.parent.iterdir()) == [path]


def test_nothing_is_read_where_nothing_is(tmp_path: Path) -> None:
    assert read(tmp_path / "none.npy") is None
    assert read(tmp_path) is None


@given(data=st.data())
def test_no_damage_goes_unnoticed(path: Path, data: st.DataObject) -> None:
    """A flipped bit anywhere, header and digest included; a file cut short or grown; bytes of zero."""
    whole = path.read_bytes()
    spoilt = bytearray(whole)
    at = data.draw(st.integers(0, len(whole) - 1))
    kind = data.draw(st.sampled_from(["flip", "cut", "grow", "zero"]))
    if kind == "flip":
        spoilt[at] ^= 1 << data.draw(st.integers(0, 7))
    elif kind == "cut":
        del spoilt[at:]
    elif kind == "grow":
        spoilt += bytes(at + 1)
    else:
        spoilt[at:] = bytes(len(spoilt) - at)
    other = path.with_name("spoilt.npy")
    other.write_bytes(spoilt)
    array = read(other)
    assert (array is not None) == (bytes(spoilt) == whole)


def test_an_array_of_something_else_is_not_taken_for_it(tmp_path: Path) -> None:
    write(tmp_path / "a.npy", holds="inputs of v2")
    assert read(tmp_path / "a.npy") is None
    write(tmp_path / "b.npy", shape=(6, 4, 3, 3))
    assert read(tmp_path / "b.npy") is None
    np.save(tmp_path / "c.npy", values())
    assert read(tmp_path / "c.npy") is None


def test_a_block_that_fails_leaves_the_old_array(tmp_path: Path) -> None:
    def fails(array: NDArray[Any]) -> None:
        raise KeyboardInterrupt

    write(tmp_path / "a.npy")
    with pytest.raises(KeyboardInterrupt):
        write_cache(tmp_path / "a.npy", holds="inputs of v1", shape=SHAPE, dtype=np.float16, fill=fails)
    assert read(tmp_path / "a.npy") is not None
    assert [file.name for file in tmp_path.iterdir()] == ["a.npy"]
