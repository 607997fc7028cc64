"""Zarr's groups and arrays as handsight uses them: many at a time, and with errors that name what is damaged."""

from __future__ import annotations

import asyncio
import math
import os
import warnings
from collections.abc import Coroutine, Iterable, Mapping, Sequence
from typing import Any

import icechunk
import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.abc.buffer import Buffer, BufferPrototype
from zarr.abc.store import RangeByteRequest, Store
from zarr.buffer import cpu
from zarr.core.metadata import ArrayMetadata
from zarr.core.sync import sync
from zarr.errors import ZarrUserWarning
from zarr.storage import StorePath

from handsight.datasets.errors import CorruptDataError, DatasetError, headline
from handsight.datasets.machine import of_the_machine

_NUMCODECS_NOTICE = "Numcodecs codecs are not in the Zarr version 3 specification"
warnings.filterwarnings("ignore", _NUMCODECS_NOTICE, ZarrUserWarning)
"""Pictures are stored with one of them (schema.py). Zarr says so whenever an array is opened, in a thread of its own,
where only a filter of the whole process reaches it."""

_FEW = 4
"""Most values of a pixel that are copied one colour after the other."""


class PixelBuffer(cpu.NDBuffer):
    """NumPy memory as zarr uses it, which copies a transposed picture colour by colour.

    NumPy copies along the last axis of its target, and of a pixel that is three bytes at a time: 0.9 ms for a picture
    of 640x480, and 0.25 ms by colour. Pictures are stored with their colours apart (schema.py).
    """

    def __setitem__(self, key: Any, value: Any) -> None:
        source = value.as_numpy_array() if isinstance(value, cpu.NDBuffer) else np.asarray(value)
        # Only slices select a view; a copy would be filled and forgotten.
        sliced = isinstance(key, tuple) and all(isinstance(one, slice) for one in key)
        if sliced and source.ndim > 1 and source.shape[-1] <= _FEW and not source.flags.c_contiguous:
            target = self.as_numpy_array()[key]
            for colour in range(source.shape[-1]):
                target[..., colour] = source[..., colour]
        else:
            self.as_numpy_array()[key] = source


PIXELS = BufferPrototype(buffer=cpu.Buffer, nd_buffer=PixelBuffer)
"""What zarr is to read pictures with."""

READ_FAILURES = (ValueError, TypeError, RuntimeError, OSError, KeyError, MemoryError, icechunk.IcechunkError)
"""What zarr, the codecs and Icechunk raise for bytes that are damaged or missing, or where the machine cannot read."""

Arrays = Mapping[str, zarr.Array[Any]]
"""Arrays of a group by their paths in it."""

Layouts = Mapping[str, ArrayMetadata]
"""Shape, chunks and codecs of arrays, by their paths in a group."""


def group_at(parent: zarr.Group, path: str) -> zarr.Group:
    """The group at a path.

    Raises:
        CorruptDataError: There is none.
        StorageError: The machine cannot read.
    """
    node = _node(parent, path)
    if not isinstance(node, zarr.Group):
        raise CorruptDataError(f"{_name(parent, path)} is an array, expected a group")
    return node


def array_at(parent: zarr.Group, path: str) -> zarr.Array[Any]:
    """The array at a path.

    Raises:
        CorruptDataError: There is none.
        StorageError: The machine cannot read.
    """
    node = _node(parent, path)
    if not isinstance(node, zarr.Array):
        raise CorruptDataError(f"{_name(parent, path)} is a group, expected an array")
    return node


def arrays_with(layouts: Layouts, store: Store, folder: str = "") -> dict[str, zarr.Array[Any]]:
    """Arrays of known layout, without reading from the store what that is: 0.02 ms each instead of 0.5."""
    return {
        path: zarr.Array(zarr.AsyncArray(metadata=layout, store_path=StorePath(store, f"{folder}/{path}".lstrip("/"))))
        for path, layout in layouts.items()
    }


def layouts_of(arrays: Arrays) -> dict[str, ArrayMetadata]:
    """What :func:`arrays_with` wants, as the arrays are now."""
    return {path: array.metadata for path, array in arrays.items()}


def read_rows(array: zarr.Array[Any], start: int, stop: int) -> NDArray[Any]:
    """Rows ``start`` to ``stop``, the latter excluded.

    Raises:
        CorruptDataError: Their bytes fail the checksum or are missing.
        StorageError: The machine cannot read them; whether they are damaged is not known.
    """
    try:
        return np.asarray(array.get_basic_selection(slice(start, stop), prototype=PIXELS))
    except READ_FAILURES as error:
        rows = f"row {start}" if stop == start + 1 else f"rows {start} to {stop - 1}"
        if isinstance(error, MemoryError) and (wanted := _claimed_bytes(array, start, stop)) > _memory_bytes():
            # No machine's fault: a few changed bits suffice to claim any number of rows.
            raise CorruptDataError(f"{array.path} is damaged: its {rows} would take {wanted} bytes") from error
        raise damage_or_trouble(
            error,
            trouble=f"{array.path} cannot be read in {rows}",
            damage=f"{array.path} is damaged in {rows}: {headline(error)}; restore the dataset from a copy",
        ) from error


def _claimed_bytes(array: zarr.Array[Any], start: int, stop: int) -> int:
    return math.prod((stop - start, *array.shape[1:])) * array.dtype.itemsize


def _memory_bytes() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def damage_or_trouble(error: Exception, *, trouble: str, damage: str) -> DatasetError:
    """The error to raise for a read that failed with one of :data:`READ_FAILURES`.

    Args:
        error: What was raised.
        trouble: What to say where the machine could not read; cause and remedy are added.
        damage: What to say where something was read and is wrong, or is not there.
    """
    return of_the_machine(trouble, error) or CorruptDataError(damage)


def read_all(array: zarr.Array[Any]) -> NDArray[Any]:
    """Every row of an array.

    Raises:
        CorruptDataError, StorageError: As for :func:`read_rows`.
    """
    return read_rows(array, 0, array.shape[0])


def read_range(array: zarr.Array[Any], start: int, stop: int) -> NDArray[Any]:
    """As :func:`read_rows`, for rows that must be there.

    Raises:
        CorruptDataError: They are damaged, or the array ends before.
        StorageError: As for :func:`read_rows`.
    """
    rows = read_rows(array, start, stop)
    if len(rows) != stop - start:
        raise CorruptDataError(f"{array.path} ends at row {array.shape[0]}, expected at least {stop}")
    return rows


def unreadable_chunk(array: zarr.Array[Any], rows: int) -> str:
    """Which of the chunks with the first rows is named but not there, and why; empty when none is.

    Raises:
        StorageError: The machine cannot look.
    """
    inner = (0,) * (array.ndim - 1)
    keys = [
        array.metadata.encode_chunk_key((row, *inner))
        for row in range(-(-min(rows, array.shape[0]) // array.chunks[0]))
    ]

    async def look(key: str) -> str:
        try:
            await (array.store_path / key).get(byte_range=RangeByteRequest(0, 1))
        except icechunk.IcechunkError as error:
            if trouble := of_the_machine(f"{array.path}/{key} cannot be read", error):
                raise trouble from error
            return f"{array.path}/{key} cannot be read ({headline(error)})"
        return ""

    async def look_at_all() -> list[str]:
        return await asyncio.gather(*(look(key) for key in keys))

    return next(filter(None, sync(look_at_all())), "")


def append_rows(array: zarr.Array[Any], rows: NDArray[Any]) -> None:
    """Add rows to the end of an array."""
    run_concurrently([truncate_and_append(array, array.shape[0], rows)])


async def overwrite(array: zarr.Array[Any], start: int, rows: NDArray[Any]) -> None:
    """Write rows over those there, from one of them on."""
    await array.async_array.setitem(slice(start, start + len(rows)), rows)


async def truncate_and_append(array: zarr.Array[Any], start: int, rows: NDArray[Any]) -> None:
    """Let an array end with some rows, from the one given on; what it had from there is gone."""
    await array.async_array.resize((start + len(rows), *array.shape[1:]))
    await overwrite(array, start, rows)


async def truncate_and_append_chunks(array: zarr.Array[Any], start: int, chunks: Sequence[Buffer | None]) -> None:
    """As :func:`truncate_and_append`, for arrays of one row a chunk and encoded chunks; None is fill values."""
    await array.async_array.resize((start + len(chunks), *array.shape[1:]))
    inner = (0,) * (array.ndim - 1)
    for row, chunk in enumerate(chunks, start):
        if chunk is not None:
            await (array.store_path / array.metadata.encode_chunk_key((row, *inner))).set(chunk)


def run_concurrently(writes: Iterable[Coroutine[Any, Any, None]]) -> None:
    """Do writes to different arrays concurrently.

    A commit writes to two dozen arrays, and one after the other would take half as long again. All are waited for,
    whatever fails, so that nothing is written behind the back of whoever handles the error.
    """

    async def all_of_them() -> None:
        outcomes = await asyncio.gather(*writes, return_exceptions=True)
        for outcome in outcomes:
            if outcome is not None:
                raise outcome

    sync(all_of_them())


def copy_group(source: zarr.Group, parent: zarr.Group, name: str) -> None:
    """Copy a group with everything in it to a path where there is nothing yet, chunk by chunk.

    Raises:
        CorruptDataError: Some of it is damaged.
        StorageError: The machine cannot read or write.
    """
    try:
        target = parent.create_group(name, attributes=source.attrs.asdict())
        for path, node in sorted(source.members(max_depth=None)):
            if isinstance(node, zarr.Group):
                target.create_group(path, attributes=node.attrs.asdict())
            else:
                # It keeps chunks and codecs by itself, but neither of these.
                kept = {"fill_value": node.fill_value, "attributes": node.attrs.asdict()}
                zarr.from_array(target.store, data=node, name=f"{target.path}/{path}", **kept)
    except READ_FAILURES as error:
        what = f"{_name(source, '')} cannot be copied"
        raise damage_or_trouble(error, trouble=what, damage=f"{what}: {headline(error)}") from error


def _node(parent: zarr.Group, path: str) -> zarr.Group | zarr.Array[Any]:
    try:
        return parent[path]
    except READ_FAILURES as error:
        what = f"{_name(parent, path)} cannot be read"
        raise damage_or_trouble(error, trouble=what, damage=f"{what}: {headline(error)}") from error


def _name(parent: zarr.Group, path: str) -> str:
    return f"{parent.path}/{path}".lstrip("/")
