"""Plain Zarr v3: the tree of schema.py in a folder of its own, which opens with any library of Zarr.

Only codecs of Zarr's own specification are used, and every axis has a name, as xarray wants it. Colours, which only
Python's zarr can decode (decision 010), are encoded anew; all other chunks are copied as they are, checksums included,
so what is wrong with one shows when it is read. The root's attribute ``handsight`` names the version that was exported.
History, releases and branches stay behind.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zarr
from zarr.abc.store import Store
from zarr.codecs import BloscCodec, Crc32cCodec
from zarr.core.buffer import default_buffer_prototype
from zarr.core.sync import sync
from zarr.errors import ZarrUserWarning
from zarr.storage import LocalStore

from handsight.datasets.errors import CorruptDataError
from handsight.datasets.exchange.bundle import Bundle, origin_of, refuse_changed, refuse_linked, schema_of_origin
from handsight.datasets.exchange.foreign import guarded, refuse, understood
from handsight.datasets.exchange.sources import stored_sources
from handsight.datasets.exchange.zarr_headers import METADATA, array_faults, claim_faults, metadata_faults
from handsight.datasets.format.arrays import array_at, group_at, read_rows, run_concurrently
from handsight.datasets.format.decisions import CURATION, DECISION_ARRAYS, read_overlay
from handsight.datasets.format.frames import BATCH_FRAMES
from handsight.datasets.format.schema import SESSION_AXES, SESSIONS, VIEWPOINTS
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.icechunk_engine import icechunk_errors

_KEYS_AT_A_TIME = 64

warnings.filterwarnings("ignore", r"Object at \._", ZarrUserWarning)
"""macOS keeps a file of that name beside every other on foreign disks. Zarr says so in a thread of its own, where only
a filter of the whole process reaches it."""


def recognises(path: Path) -> bool:
    """Whether the path is a folder with the root of a Zarr v3 hierarchy."""
    return path.is_dir() and (path / METADATA).is_file()


def write(dataset: GraspDataset, path: Path, on_attempt: Callable[[], None]) -> None:
    """Write a version to a new folder.

    Raises:
        CorruptDataError: A picture is damaged; the message names its row.
    """
    root = dataset.root
    with icechunk_errors(f"cannot read {dataset.repository.path}"):
        for session in dataset.sessions:
            folder = f"{SESSIONS}/{session.ulid}"
            colours = {viewpoint: f"{folder}/{viewpoint}/rgb" for viewpoint in VIEWPOINTS}
            _copy(root.store, f"{folder}/", path, without=tuple(colours.values()))
            for viewpoint, name in colours.items():
                _encode_anew(array_at(root, name), path, on_attempt if viewpoint == VIEWPOINTS[0] else None)
        _copy(root.store, "", path)
    zarr.open_group(LocalStore(path), mode="r+").update_attributes({"handsight": origin_of(dataset)})


def _encode_anew(array: zarr.Array[Any], target: Path, on_attempt: Callable[[], None] | None) -> None:
    """Write an array of pictures with Zarr's own codecs, a few in memory at a time."""
    shape = array.shape
    # One block for the whole picture: what repeats is found wherever it was before.
    blosc = BloscCodec(typesize=1, cname="zstd", clevel=3, shuffle="noshuffle", blocksize=math.prod(shape[1:]))
    written = zarr.create_array(
        LocalStore(target),
        name=array.path,
        shape=shape,
        chunks=array.chunks,
        dtype=array.dtype,
        compressors=(blosc, Crc32cCodec()),
        fill_value=array.fill_value,
        attributes=array.attrs.asdict(),
        dimension_names=_axes_of(array.path, len(shape)),
    )
    for start in range(0, shape[0], BATCH_FRAMES):
        stop = min(start + BATCH_FRAMES, shape[0])
        written[start:stop] = read_rows(array, start, stop)
        if on_attempt is not None:
            for _ in range(start, stop):
                on_attempt()


def _axes_of(path: str, count: int) -> tuple[str, ...]:
    """Names for the axes of an array that was made before axes had any."""
    _, _, in_session = path.removeprefix(f"{SESSIONS}/").partition("/")
    name = path.rpartition("/")[2]
    return SESSION_AXES.get(in_session, tuple(f"{name}_axis_{axis}" for axis in range(count)))


@contextmanager
def open_bundle(path: Path) -> Iterator[Bundle]:
    """Open a folder for import.

    Raises:
        InterchangeError: The folder is foreign, newer, changed, or holds links.
        CorruptDataError: An array is missing or damaged.
        StorageError: It cannot be read.
    """
    refuse_linked(path)
    with understood(path, "was not exported by handsight, or is damaged"):
        refuse(path, metadata_faults(path))
        root = zarr.open_group(LocalStore(path, read_only=True), mode="r")
        attributes: dict[str, Any] = root.attrs.asdict()
        origin = attributes.get("handsight", attributes)
        schema = schema_of_origin(origin, path)
        refuse(path, claim_faults(path, _never_empty(root)))
        sessions = stored_sources(root, schema)
        refuse(path, array_faults(path, sessions, schema))
        refuse_changed(origin, sessions, path)
        decisions = read_overlay(root).decisions
    yield Bundle(sessions=guarded(sessions, path), decisions=decisions)


def _never_empty(root: zarr.Group) -> list[str]:
    """Paths of arrays that are read as a whole and have no chunk of zeros: no digest is, nor any decision."""
    digests = [f"{SESSIONS}/{ulid}/attempts/digest" for ulid in group_at(root, SESSIONS).group_keys()]
    return [*digests, *(f"{CURATION}/{name}" for name in DECISION_ARRAYS)]


def _copy(store: Store, prefix: str, target: Path, *, without: Sequence[str] = ()) -> None:
    """Copy what lies under a prefix and is not there yet, but for some folders."""
    left_out = tuple(f"{folder}/" for folder in without)
    keys = (key for key in sync(_keys(store, prefix)) if not key.startswith(left_out))
    missing = [key for key in keys if not (target / key).exists()]
    for start in range(0, len(missing), _KEYS_AT_A_TIME):
        some = missing[start : start + _KEYS_AT_A_TIME]
        run_concurrently(_copy_key(store, key, target / key) for key in some)


async def _keys(store: Store, prefix: str) -> list[str]:
    return sorted([key async for key in store.list_prefix(prefix)])


async def _copy_key(store: Store, key: str, target: Path) -> None:
    value = await store.get(key, default_buffer_prototype())
    if value is None:
        raise CorruptDataError(f"{key} is listed in the dataset and cannot be read: restore the dataset from a copy")
    data = value.to_bytes()
    folder, _, name = key.rpartition("/")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(_with_axes(data, folder) if name == METADATA else data)


def _with_axes(metadata: bytes, path: str) -> bytes:
    """Metadata of a node, with names for the axes of an array that has none."""
    values = json.loads(metadata)
    if values["node_type"] != "array" or values.get("dimension_names"):
        return metadata
    return json.dumps({**values, "dimension_names": _axes_of(path, len(values["shape"]))}).encode()
