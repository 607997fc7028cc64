"""Plain Zarr v3: the tree of schema.py in a folder of its own, which opens with zarr alone.

Chunks are copied as they are, checksums included, so what is wrong with one shows when it is read. The root's attribute
``handsight`` names the version that was exported. History, releases and branches stay behind.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zarr
from zarr.abc.store import Store
from zarr.core.buffer import default_buffer_prototype
from zarr.core.sync import sync
from zarr.storage import LocalStore

from handsight.datasets.errors import CorruptDataError, InterchangeError, counted
from handsight.datasets.exchange.bundle import Bundle, origin_of, refuse_incomplete, refuse_linked, schema_of_origin
from handsight.datasets.exchange.sources import stored_sources
from handsight.datasets.format.arrays import array_at, group_at
from handsight.datasets.format.decisions import read_overlay
from handsight.datasets.format.schema import SESSIONS, VIEWPOINTS
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.icechunk_engine import icechunk_errors

_METADATA = "zarr.json"
_KEYS_AT_A_TIME = 64


def recognises(path: Path) -> bool:
    """Whether the path is a folder with the root of a Zarr v3 hierarchy."""
    return path.is_dir() and (path / _METADATA).is_file()


def write(dataset: GraspDataset, path: Path, on_attempt: Callable[[], None]) -> None:
    """Write a version to a new folder."""
    root = dataset.root
    with icechunk_errors(f"cannot read {dataset.repository.path}"):
        for session in dataset.sessions:
            copied = _copy(root.store, f"{SESSIONS}/{session.ulid}/", path, on_attempt)
            for _ in range(session.attempts - copied):
                on_attempt()
        _copy(root.store, "", path, None)
    zarr.open_group(LocalStore(path), mode="r+").update_attributes({"handsight": origin_of(dataset)})


@contextmanager
def open_bundle(path: Path) -> Iterator[Bundle]:
    """Open a folder for import.

    Raises:
        InterchangeError: The folder is foreign, newer, or holds links.
        CorruptDataError: An array is missing or damaged.
    """
    refuse_linked(path)
    try:
        root = zarr.open_group(LocalStore(path, read_only=True), mode="r")
        attributes: dict[str, Any] = root.attrs.asdict()
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InterchangeError(f"{path} has no readable group at its root: {error}") from error
    origin = attributes.get("handsight", attributes)
    schema = schema_of_origin(origin, path)
    _refuse_empty_claims(path, root)
    sessions = stored_sources(root, schema)
    refuse_incomplete(origin, sessions, path)
    yield Bundle(sessions=sessions, decisions=read_overlay(root).decisions)


def _refuse_empty_claims(path: Path, root: zarr.Group) -> None:
    """Refuse sessions with more rows than chunks could hold, before memory is set aside for them.

    A few bytes suffice to claim any number of rows, but no digest is all zeros, so every chunk of digests is a file.
    """
    for ulid, session in group_at(root, SESSIONS).groups():
        digests, rows = array_at(session, "attempts/digest"), array_at(session, "attempts/number").shape[0]
        files = sum(file.is_file() for file in (path / SESSIONS / ulid / "attempts/digest/c").rglob("*"))
        if digests.shape[0] != rows or digests.nchunks > files:
            raise CorruptDataError(
                f"session {ulid} of {path} claims {counted(rows, 'attempt')} and has {files} of {digests.nchunks} "
                "chunks of their digests: take an undamaged copy"
            )


def _copy(store: Store, prefix: str, target: Path, on_attempt: Callable[[], None] | None) -> int:
    """Copy what lies under a prefix and is not there yet; returns how often ``on_attempt`` was called."""
    missing = [key for key in sync(_keys(store, prefix)) if not (target / key).exists()]
    first_frames = f"/{VIEWPOINTS[0]}/rgb/c/"
    copied = 0
    for start in range(0, len(missing), _KEYS_AT_A_TIME):
        some = missing[start : start + _KEYS_AT_A_TIME]
        sync(_copy_keys(store, some, target))
        if on_attempt is not None:
            for _ in [key for key in some if first_frames in key]:
                copied += 1
                on_attempt()
    return copied


async def _keys(store: Store, prefix: str) -> list[str]:
    return sorted([key async for key in store.list_prefix(prefix)])


async def _copy_keys(store: Store, keys: Sequence[str], target: Path) -> None:
    await asyncio.gather(*(_copy_key(store, key, target / key) for key in keys))


async def _copy_key(store: Store, key: str, target: Path) -> None:
    value = await store.get(key, default_buffer_prototype())
    if value is None:
        raise CorruptDataError(f"{key} is listed in the dataset and cannot be read: restore the dataset from a copy")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(value.to_bytes())
