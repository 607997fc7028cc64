"""A memory-mapped array that is known to be what was written, and for what.

The file is a plain ``.npy`` with a SHA-256 behind the array, which NumPy does not look at. It is over the name of what
the array holds and all that lies before, so that a flipped bit, a file cut short and the array of something else are
all found. Reading it once costs under a second for each gigabyte, a small part of one pass of training over it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from handsight.datasets.atomic import atomic_file
from handsight.datasets.errors import CorruptDataError, counted

_DIGEST_BYTES = hashlib.sha256().digest_size
_BLOCK_BYTES = 1 << 20


def write_cache(
    path: Path, *, holds: str, shape: tuple[int, ...], dtype: DTypeLike, fill: Callable[[NDArray[Any]], None]
) -> None:
    """Write the array that ``fill`` fills in; whole or absent, whoever else writes the same.

    Args:
        path: The file to be; its folder exists.
        holds: What the array is; only who names the same can read it.
        shape: Of the array.
        dtype: Of the array.
        fill: Writes every value of the array that it is given.
    """
    with atomic_file(path) as unfinished:
        array = np.lib.format.open_memmap(unfinished, mode="w+", dtype=dtype, shape=shape)
        fill(array)
        array.flush()
        digest = _digest(unfinished, holds, unfinished.stat().st_size)
        with unfinished.open("ab") as file:
            file.write(digest)


def open_cache(path: Path, *, holds: str, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any] | None:
    """The array in the file, mapped; None where there is none that :func:`write_cache` was given the same of.

    Raises:
        OSError: It cannot be read.
    """
    if not path.is_file():
        return None
    array_bytes = path.stat().st_size - _DIGEST_BYTES
    if array_bytes < 0 or _digest(path, holds, array_bytes) != _stored_digest(path, array_bytes):
        return None
    array: NDArray[Any] = np.load(path, mmap_mode="r")
    return array if (array.shape, array.dtype) == (shape, np.dtype(dtype)) else None


def mapped_again(path: Path, *, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """An array that another process has opened by :func:`open_cache`: its bytes were checked there.

    Raises:
        CorruptDataError: The file does not hold what it held.
        OSError: It cannot be read.
    """
    remedy = "delete it, so that it is made again"
    try:
        mapped: NDArray[Any] = np.load(path, mmap_mode="r")
    except ValueError as error:
        raise CorruptDataError(f"{path} is no array of inputs ({error}): {remedy}") from error
    if mapped.shape[1:] != shape[1:] or mapped.dtype != np.dtype(dtype):
        found = f"{mapped.dtype} of shape {mapped.shape}"
        raise CorruptDataError(f"{path} holds {found}, expected {np.dtype(dtype)} of shape {shape}: {remedy}")
    if len(mapped) != shape[0]:
        raise CorruptDataError(
            f"{path} holds {counted(len(mapped), 'input')}, expected {shape[0]}: pickle a dataset that was made from "
            "all inputs of a version, and choose rows with a sampler"
        )
    return mapped


def _digest(path: Path, holds: str, array_bytes: int) -> bytes:
    """Of what the array is and of the first bytes of the file."""
    digest = hashlib.sha256(holds.encode())
    block = bytearray(_BLOCK_BYTES)
    with path.open("rb", buffering=0) as file:
        left = array_bytes
        while left and (count := file.readinto(memoryview(block)[:left])):
            digest.update(memoryview(block)[:count])
            left -= count
    return digest.digest()


def _stored_digest(path: Path, array_bytes: int) -> bytes:
    with path.open("rb") as file:
        file.seek(array_bytes)
        return file.read()
