"""Exports as an editor, a failing disk or a stranger leaves them. Each change follows from the generator alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

ODD: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    1,
    2**31,
    2**63,
    10**30,
    0.5,
    float("nan"),
    "",
    "x" * 300,
    "é\0",
    [],
    {},
    [[]],
)
ODD_ATTRIBUTES: tuple[Any, ...] = (
    -1,
    0,
    2**62,
    0.5,
    np.nan,
    "",
    "{",
    "[]",
    "é",
    b"\xff",
    np.zeros((3, 2)),
    np.arange(99),
)


def spoil_hdf5(path: Path, rng: np.random.Generator) -> None:
    """Change an HDF5 file in one place: bytes in a third of the cases, else its content through h5py."""
    if rng.integers(3) == 0:
        spoil_bytes(path, rng)
        return
    with h5py.File(path, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        name = names[int(rng.integers(len(names)))]
        _choice((_other_attribute, _no_node, _other_shape, _other_type, _other_values, _link, _moved), rng)(
            file, name, rng
        )


def spoil_zarr(folder: Path, rng: np.random.Generator) -> None:
    """Change a plain Zarr folder in one file: its metadata in half of the cases, else a chunk, or one is missing."""
    metadata = sorted(folder.rglob("zarr.json"))
    chunks = sorted(path for path in folder.rglob("c/**/*") if path.is_file())
    kind = int(rng.integers(4))
    if kind < 2:
        spoil_json(_choice(metadata, rng), rng)
    elif kind == 2:
        spoil_bytes(_choice([*metadata, *chunks], rng), rng)
    else:
        _choice([*metadata, *chunks], rng).unlink()


def spoil_bytes(path: Path, rng: np.random.Generator) -> None:
    """Flip a few bits, overwrite a stretch, or cut the end off."""
    data = bytearray(path.read_bytes())
    kind, place = int(rng.integers(3)), int(rng.integers(len(data)))
    if kind == 0:
        for at in rng.integers(len(data), size=int(rng.integers(1, 9))).tolist():
            data[at] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        stretch = data[place : place + int(rng.integers(1, 65))]
        data[place : place + len(stretch)] = rng.bytes(len(stretch))
    else:
        del data[place:]
    path.write_bytes(data)


def spoil_json(path: Path, rng: np.random.Generator) -> None:
    """Give one place of a JSON file another value, or take it out."""
    value = json.loads(path.read_text())
    parent: Any = None
    node, key = value, None
    while isinstance(node, dict | list) and node and (parent is None or rng.random() < 0.8):
        parent, key = node, _choice(list(node) if isinstance(node, dict) else list(range(len(node))), rng)
        node = parent[key]
    if parent is None or rng.random() < 0.05:
        value = _choice(ODD, rng)
    elif rng.random() < 0.2:
        del parent[key]
    else:
        parent[key] = _choice(ODD, rng)
    path.write_text(json.dumps(value))


def _other_attribute(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    holder = _choice((file, file["data"], *file["data"].values(), *file["sessions"].values()), rng)
    if len(holder.attrs):
        holder.attrs[_choice(sorted(holder.attrs), rng)] = _choice(ODD_ATTRIBUTES, rng)


def _no_node(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    del file[name]


def _other_shape(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    if isinstance(file[name], h5py.Dataset):
        dtype, shape = file[name].dtype, list(file[name].shape) or [1]
        shape[int(rng.integers(len(shape)))] = _choice((0, 1, 7, 10**6, 10**12), rng)
        del file[name]
        chunks = tuple(min(side, 16) for side in shape) if all(shape) else None
        file.create_dataset(name, shape=tuple(shape), dtype=dtype, chunks=chunks)


def _other_type(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    if isinstance(file[name], h5py.Dataset):
        shape = file[name].shape
        del file[name]
        dtype = _choice(("f4", "i8", "u1", "S3", h5py.string_dtype(), [("a", "i4")], h5py.ref_dtype, ">f8", "c8"), rng)
        file.create_dataset(name, shape=shape, dtype=dtype)


def _other_values(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    node = file[name]
    if isinstance(node, h5py.Dataset) and node.dtype.kind == "f":
        node[...] = _choice((np.nan, np.inf, -1e300, 0.25, 85.0), rng)
    elif isinstance(node, h5py.Dataset) and node.dtype.kind in "iu":
        node[...] = _choice((0, 1, 99, 127), rng)
    elif isinstance(node, h5py.Dataset) and h5py.check_string_dtype(node.dtype) and node.shape == ():
        text = json.loads(node.asstr()[()])
        del file[name]
        file[name] = json.dumps(_choice((*ODD, text, [text], {"header": text}), rng))


def _link(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    del file[name]
    file[name] = _choice((h5py.SoftLink("/data"), h5py.ExternalLink("/etc/passwd", "/"), file["data"], file), rng)


def _moved(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    file.move(name, _choice(("x", "data/demo_x", "sessions/x", "mask/x", "data/demo_99"), rng))


def _choice(options: Any, rng: np.random.Generator) -> Any:
    return options[int(rng.integers(len(options)))]


SPOILERS: dict[str, Callable[[Path, np.random.Generator], None]] = {"hdf5": spoil_hdf5, "zarr": spoil_zarr}
"""By the name of the format."""
