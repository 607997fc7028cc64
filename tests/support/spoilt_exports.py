"""Exports as an editor, a failing disk or a stranger leaves them. Each change follows from the generator alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from tests.support.fuzz_mutations import ODD_VALUES, mutate_bytes, mutate_json_text

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
        path.write_bytes(mutate_bytes(path.read_bytes(), rng))
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
        file = _choice(metadata, rng)
        file.write_text(mutate_json_text(file.read_text(), rng), errors="surrogatepass")
    elif kind == 2:
        file = _choice([*metadata, *chunks], rng)
        file.write_bytes(mutate_bytes(file.read_bytes(), rng))
    else:
        _choice([*metadata, *chunks], rng).unlink()


def _other_attribute(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    nodes: list[Any] = [file]
    file.visititems(lambda _, node: nodes.append(node))
    holder = _choice([node for node in nodes if len(node.attrs)], rng)
    key = _choice(sorted(holder.attrs), rng)
    text = holder.attrs[key]
    if isinstance(text, str) and text.startswith(("{", "[")) and rng.random() < 0.6:
        holder.attrs[key] = mutate_json_text(text, rng).encode(errors="replace").replace(b"\0", b"")[:60_000]
    else:
        holder.attrs[key] = _choice(ODD_ATTRIBUTES, rng)


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
        text = node.asstr()[()]
        del file[name]
        spoilt = mutate_json_text(text, rng) if rng.integers(2) else json.dumps(_choice(ODD_VALUES, rng))
        file[name] = spoilt.encode(errors="replace").replace(b"\0", b"").decode(errors="replace")


def _link(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    del file[name]
    links = (
        h5py.SoftLink("/data"),
        h5py.SoftLink(name),
        h5py.ExternalLink("/etc/passwd", "/"),
        file.get("data", file),
        file,
    )
    file[name] = _choice(links, rng)


def _moved(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    places = ("x", "data/demo_x", "sessions/x", "mask/x", "data/demo_99", "\u00e9\u202e", "data/x/y/z")
    place = _choice([one for one in places if one not in file], rng)
    if not place.startswith(f"{name}/"):
        file.move(name, place)


def _choice(options: Any, rng: np.random.Generator) -> Any:
    return options[int(rng.integers(len(options)))]


SPOILERS: dict[str, Callable[[Path, np.random.Generator], None]] = {"hdf5": spoil_hdf5, "zarr": spoil_zarr}
"""By the name of the format."""
