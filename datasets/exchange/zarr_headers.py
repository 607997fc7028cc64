"""What the arrays of a plain Zarr folder claim of themselves, checked before Zarr reads one of them."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from handsight.datasets.errors import counted
from handsight.datasets.exchange.sources import SessionSource
from handsight.datasets.format.schema import SESSIONS, VIEWPOINTS, column_widths
from handsight.datasets.format.upgrades import columns_of

METADATA = "zarr.json"
CODECS = frozenset({"bytes", "blosc", "zstd", "gzip", "crc32c", "transpose", "numcodecs.delta"})
"""Those that datasets and exports of any schema have been written with, and what others may have encoded them with."""

_MOST_METADATA_BYTES = 2**24
_MOST_CHUNK_BYTES = 2**28
"""A picture of the largest camera, in one chunk."""
_MOST_ROWS = 2**40
_MOST_TEXT = 80

_Metadata = dict[str, Any]


def metadata_faults(path: Path) -> list[str]:
    """What is wrong with the metadata of groups and arrays, each by itself."""
    faults = []
    for folder, _, files in os.walk(path):
        if METADATA in files:
            name = str(Path(folder).relative_to(path) / METADATA)
            faults += [f"{name}: {fault}" for fault in _node_faults(Path(folder) / METADATA)]
    return faults


def array_faults(path: Path, sources: Sequence[SessionSource], schema: int) -> list[str]:
    """Where arrays of sessions, whose metadata are sound, are not what the headers of their sessions say."""
    faults = []
    for source in sources:
        intrinsics = source.header.station.camera.intrinsics
        widths = column_widths(source.header)
        frame = (intrinsics.height, intrinsics.width)
        kinds: dict[str, tuple[str, tuple[int, ...]]] = {
            f"attempts/{column.name}": (column.dtype, column.shape(widths)) for column in columns_of(schema)
        }
        for view in VIEWPOINTS:
            kinds |= {f"{view}/rgb": ("uint8", (*frame, 3)), f"{view}/depth": ("uint16", frame)}
            kinds[f"{view}/pose_base_tool"] = ("float64", (4, 4))
        for name, (dtype, row) in kinds.items():
            metadata = _read(path / SESSIONS / source.ulid / name / METADATA)
            if metadata is None:
                continue  # Whoever reads it says so.
            found, expected = (metadata["data_type"], metadata["shape"]), (dtype, [source.size, *row])
            if found != expected:
                where = f"{SESSIONS}/{source.ulid}/{name}"
                faults.append(f"{where} is {found[0]} {found[1]}, expected {expected[0]} {expected[1]}")
    return faults


def claim_faults(path: Path, arrays: Sequence[str]) -> list[str]:
    """Where arrays claim more chunks than there are files: a few bytes suffice to claim any number of rows.

    For arrays of which no chunk can be all zeros, which would be no file.
    """
    faults = []
    for name in arrays:
        metadata = _read(path / name / METADATA)
        if metadata is None:
            continue
        chunks = metadata["chunk_grid"]["configuration"]["chunk_shape"]
        claimed = math.prod(-(-side // chunk) for side, chunk in zip(metadata["shape"], chunks, strict=True))
        files = sum(not file.startswith(".") for _, _, files in os.walk(path / name / "c") for file in files)
        if claimed > files:
            rows = counted(metadata["shape"][0], "row")
            faults.append(f"{name} claims {rows} in {counted(claimed, 'chunk')}, and {files} are there")
    return faults


def _read(file: Path) -> _Metadata | None:
    return json.loads(file.read_bytes()) if file.is_file() else None


def _node_faults(file: Path) -> list[str]:
    if file.stat().st_size > _MOST_METADATA_BYTES:
        return [f"it has {file.stat().st_size} bytes, expected at most {_MOST_METADATA_BYTES}"]
    try:
        metadata = json.loads(file.read_bytes())
    except (ValueError, RecursionError) as error:
        return [f"it is no JSON: {str(error)[:_MOST_TEXT]}"]
    if not isinstance(metadata, dict):
        return [f"it is {_shown(metadata)}, expected an object"]
    faults = (
        []
        if metadata.get("zarr_format") == 3
        else [f"zarr_format is {_shown(metadata.get('zarr_format'))}, expected 3"]
    )
    if not isinstance(metadata.get("attributes", {}), dict):
        faults.append(f"attributes are {_shown(metadata['attributes'])}, expected an object")
    if metadata.get("node_type") == "group":
        return faults
    if metadata.get("node_type") != "array":
        return [*faults, f"node_type is {_shown(metadata.get('node_type'))}, expected group or array"]
    return faults + _array_faults(metadata)


def _array_faults(metadata: _Metadata) -> list[str]:
    faults = []
    shape, grid = metadata.get("shape"), metadata.get("chunk_grid")
    chunks = _inside(grid, "configuration", "chunk_shape")
    if not _are_sizes(shape, least=0):
        faults.append(f"shape is {_shown(shape)}, expected sizes up to {_MOST_ROWS}")
    if not _are_sizes(chunks, least=1) or not isinstance(shape, list) or len(chunks) != len(shape):
        faults.append(f"chunk_shape is {_shown(chunks)}, expected a size for each axis")
    dtype = metadata.get("data_type")
    try:
        known = isinstance(dtype, str) and np.dtype(dtype).kind in "biuf" and np.dtype(dtype).name == dtype
    except TypeError:
        known = False
    if not known:
        faults.append(f"data_type is {_shown(dtype)}, expected a type of numbers")
    elif not faults and math.prod(chunks) * np.dtype(dtype).itemsize > _MOST_CHUNK_BYTES:
        faults.append(f"chunk_shape is {_shown(chunks)}, expected at most {_MOST_CHUNK_BYTES} bytes a chunk")
    codecs = metadata.get("codecs")
    names = [_inside(codec, "name") for codec in codecs] if isinstance(codecs, list) else [codecs]
    strange = [name for name in names if not isinstance(name, str) or name not in CODECS]
    if strange:
        faults.append(f"codecs hold {_shown(strange[0])}, expected some of {', '.join(sorted(CODECS))}")
    return faults


def _inside(value: Any, *path: str) -> Any:
    for key in path:
        value = value.get(key) if isinstance(value, dict) else None
    return value


def _are_sizes(value: Any, *, least: int) -> bool:
    return isinstance(value, list) and all(type(one) is int and least <= one <= _MOST_ROWS for one in value)


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _MOST_TEXT else f"{text[:_MOST_TEXT]}…"
