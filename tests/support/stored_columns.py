"""Values that handsight never writes, put into stored arrays and attributes with sound checksums.

Some other program may have written them, or an older one with a fault; no checksum of the store finds them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from handsight.datasets import GraspRepository

TEXTS = ("failure", "reason", "author")
"""Arrays of bytes that hold UTF-8, by the end of their path."""


_PATHS: dict[str, list[str]] = {}
"""Of the versions that were looked at: the same one is spoilt again and again, in a copy each time."""


def odd_values(path: str, array: zarr.Array[Any]) -> list[NDArray[Any]]:
    """Rows for an array that no attempt, decision or division into folds can have."""
    dtype, row = np.dtype(array.dtype), array.shape[1:]
    if path.rpartition("/")[2] in TEXTS:
        return [np.full(row, 0xFF, np.uint8), np.resize(np.frombuffer(b"a\0b\0", np.uint8), row)]
    if dtype.kind == "b":
        return [np.full(row, flag) for flag in (True, False)]
    if dtype.kind in "iu":
        limits = np.iinfo(dtype)
        values = {limits.min, limits.max, limits.min + 1, 4, 2**40, -2} & set(_range(limits))
        return [np.full(row, value, dtype) for value in sorted(values)]
    return [np.full(row, value, dtype) for value in (np.nan, np.inf, -np.inf, -1e30, 1e30, 0.0)]


def _range(limits: np.iinfo[Any]) -> tuple[int, ...]:
    wanted = (limits.min, limits.max, limits.min + 1, 4, 2**40, -2)
    return tuple(value for value in wanted if limits.min <= value <= limits.max)


def small_arrays(folder: Path) -> list[str]:
    """Paths of all arrays on the branch ``main`` of a dataset, but those of pictures."""
    repository = GraspRepository.open(folder)
    snapshot = repository.resolve("main")
    if snapshot not in _PATHS:
        members = repository.root(snapshot).members(max_depth=None)
        _PATHS[snapshot] = sorted(
            path for path, node in members if isinstance(node, zarr.Array) and not path.endswith(("rgb", "depth"))
        )
    return _PATHS[snapshot]


def tamper(folder: Path, path: str, row: int, value: NDArray[Any] | None = None, *, rows: int | None = None) -> None:
    """Commit a value to a row of an array of ``main``, or another length of that array."""
    repository = GraspRepository.open(folder)
    transaction = repository.writable("main")
    array = zarr.open_group(transaction.store, mode="r+")[path]
    assert isinstance(array, zarr.Array)
    if rows is not None:
        array.resize((rows, *array.shape[1:]))
    elif value is not None:
        array[row] = value
    repository.commit(transaction, branch="main", message="tamper")


def tamperings(folder: Path) -> Iterator[tuple[str, int]]:
    """Every array of a dataset with the number of odd values there are for it."""
    repository = GraspRepository.open(folder)
    root = repository.root(repository.resolve("main"))
    for path in small_arrays(folder):
        array = root[path]
        assert isinstance(array, zarr.Array)
        yield path, len(odd_values(path, array))
