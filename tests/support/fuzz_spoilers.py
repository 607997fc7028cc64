"""Changes that know what they change: headers that lie, columns of another type, values that nobody writes."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import icechunk
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import zarr
from tests.support.foreign_sets import damaged_map
from tests.support.fuzz_mutations import (
    ODD_WORDS,
    mutate_bytes,
    mutate_file,
    mutate_folder,
    mutate_json,
    mutate_json_text,
    mutate_text,
    one_of,
)
from tests.support.fuzz_sources import command
from tests.support.image_table_mutations import mutate_image_table
from tests.support.run_mutations import mutate_run
from tests.support.spoilt_exports import spoil_hdf5, spoil_zarr
from tests.support.stored_columns import odd_values, small_arrays, tamper

from handsight.datasets import GraspRepository
from handsight.datasets.format.header import canonical_json


def spoil_images(file: str, folder: Path, rng: np.random.Generator) -> None:
    """A file of a table of pictures, as any file of its kind or as an editor would."""
    if rng.random() < 0.5:
        mutate_image_table(folder / "set", rng)
    else:
        mutate_file(one_of(sorted((folder / "set").glob(file)), rng), rng)


def spoil_hdf5_file(folder: Path, rng: np.random.Generator) -> None:
    """The HDF5 file of a folder."""
    (path,) = folder.glob("*.hdf5")
    if rng.random() < 0.05:
        mutate_file(path, rng)
    else:
        spoil_hdf5(path, rng)


def spoil_zarr_folder(folder: Path, rng: np.random.Generator) -> None:
    """A plain Zarr folder."""
    if rng.random() < 0.5:
        mutate_folder(folder / "set.zarr", rng)
    else:
        spoil_zarr(folder / "set.zarr", rng)


def spoil_lerobot(folder: Path, rng: np.random.Generator) -> None:
    """A table, an archive of columns, or any file of a set."""
    kind = int(rng.integers(4))
    tables, archives = (sorted((folder / "set").rglob(pattern)) for pattern in ("*.parquet", "*.npz"))
    if kind <= 1:
        spoil_parquet(one_of(tables, rng), rng)
    elif kind == 2 and archives:
        spoil_npz(one_of(archives, rng), rng)
    else:
        mutate_folder(folder / "set", rng)


def spoil_parquet(path: Path, rng: np.random.Generator) -> None:
    """A column of another type, gone, twice or of nulls; rows gone, doubled or in another order."""
    try:
        table = pq.read_table(path)
    except (pa.ArrowException, OSError):
        return mutate_file(path, rng)
    if not len(table.column_names) or not len(table):
        return mutate_file(path, rng)
    at = int(rng.integers(len(table.column_names)))
    name, rows = table.column_names[at], len(table)
    columns: tuple[Callable[[], pa.Array], ...] = (
        lambda: pa.nulls(rows),
        lambda: pa.array(["x"] * rows),
        lambda: pa.array([2**63] * rows, pa.uint64()),
        lambda: pa.array([float("nan")] * rows),
        lambda: pa.array([[1.0] * (row % 3) for row in range(rows)]),
        lambda: pa.array([b"\xff"] * rows),
        lambda: pa.array([{"bytes": mutate_bytes(b"\x89PNG\r\n\x1a\n", rng), "path": None}] * rows),
        lambda: pa.array([{"bytes": None, "path": "/etc/passwd"}] * rows),
        lambda: pa.array(["a"] * rows).dictionary_encode(),
        lambda: pa.array([-1] * rows, pa.int8()),
    )
    changes: tuple[Callable[[], pa.Table], ...] = (
        *(lambda: table.set_column(at, name, one_of(columns, rng)()),) * 4,
        lambda: table.remove_column(at),
        lambda: table.append_column(name, table[name]),
        lambda: table.slice(0, int(rng.integers(rows))),
        lambda: pa.concat_tables([table, table]),
        lambda: table.take(list(range(rows))[::-1]),
        lambda: table.rename_columns([one_of(ODD_WORDS, rng) if one == name else one for one in table.column_names]),
    )
    pq.write_table(one_of(changes, rng)(), path)
    return None


def spoil_npz(path: Path, rng: np.random.Generator) -> None:
    """An archive of which one array has another type or shape, a header that lies, or stands there twice or never."""
    with zipfile.ZipFile(path) as file:
        members = {name: file.read(name) for name in file.namelist()}
    name = one_of(sorted(members), rng)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for other, content in members.items():
            file.writestr(other, spoilt_npy(content, rng) if other == name else content)
        if rng.random() < 0.1:
            file.writestr(one_of(("../x.npy", "\u202e.npy", "x" * 300), rng), members[name])


def spoilt_npy(content: bytes, rng: np.random.Generator) -> bytes:
    """An array of another type or shape, or one that claims to be what it is not."""
    values = np.lib.format.read_array(io.BytesIO(content))
    kind = int(rng.integers(4))
    if kind == 0:
        return mutate_bytes(content, rng)
    out = io.BytesIO()
    if kind == 1:
        shapes: tuple[Any, ...] = (
            (-1,),
            (2**62,),
            (2**40, 2**40),
            (),
            (0,),
            ("a",),
            (1.5,),
            (True,),
            None,
            [1],
            (1,) * 99,
        )
        header = {"descr": values.dtype.str, "fortran_order": False, "shape": one_of(shapes, rng)}
        if rng.random() < 0.3:
            header["descr"] = one_of(("|O", "<f999", "", "<U9999999", [("a", "<f8")], 5, "<m8[ns]"), rng)
        text = (repr(header) + "\n").encode()
        return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + values.tobytes()
    if kind == 2:
        with np.errstate(all="ignore"):
            values = values.astype(one_of(("f4", "i8", "u1", ">f8", "S3", "c8", "U1"), rng), copy=False)
    elif values.dtype.kind == "b":
        values = ~values
    else:
        odd = (0, 1, 100, -1) if values.dtype.kind in "iu" else (np.nan, np.inf, -1e300, 0)
        with np.errstate(all="ignore"):
            values = np.full_like(values, np.asarray(one_of(odd, rng)).astype(values.dtype))
    np.lib.format.write_array(out, values)
    return out.getvalue()


def spoil_foreign(spoil: Callable[[Path, np.random.Generator], None], folder: Path, rng: np.random.Generator) -> None:
    """The set, or the map of it."""
    if rng.random() < 0.7:
        spoil(folder, rng)
    else:
        mutate_file(folder / "map.toml", rng)


def spoil_map(tables: dict[str, Any], folder: Path, rng: np.random.Generator) -> None:
    """The map: its text, or a value of it."""
    if rng.random() < 0.5:
        mutate_file(folder / "map.toml", rng)
    else:
        damaged_map(tables, rng, folder / "map.toml")


def spoil_run(folder: Path, rng: np.random.Generator) -> None:
    """A record or weights."""
    if rng.random() < 0.6:
        mutate_run(folder / "run", rng)
    else:
        mutate_folder(folder / "run", rng)


def spoil_cache(folder: Path, rng: np.random.Generator) -> None:
    """The inputs that were made: damaged, foreign, or those of something else."""
    (path,) = (folder / "grasps").rglob("*.npy")
    if rng.random() < 0.6:
        mutate_file(path, rng)
    elif rng.random() < 0.5:
        path.write_bytes(spoilt_npy(path.read_bytes(), rng))
    else:
        other: Any = one_of((np.zeros((8, 4, 8, 8), np.float16), np.zeros(3), np.zeros((0, 4, 8, 8), np.float16)), rng)
        np.save(path, other)


READING = (
    *(("ls", "--json"), ("ls",), ("ls", "--where=success == 1"), ("ls", "--sort=target"), ("show", "1"), ("stats",)),
    *(("show", "2", "--json"), ("stats", "--json"), ("info",), ("info", "--json"), ("decisions",), ("folds", "cv")),
    *(("filter",), ("log", "--json"), ("doctor", "--deep"), ("materialize", "--size=8"), ("verify", "--jobs=1")),
)
"""Commands on a dataset that change nothing in it."""


def spoil_columns(folder: Path, rng: np.random.Generator) -> list[list[str]]:
    """A value that nobody writes in a stored array, or another length of it; returns what is to be read."""
    dataset = folder / "grasps"
    path = one_of(small_arrays(dataset), rng)
    repository = GraspRepository.open(dataset)
    array = repository.root(repository.resolve("main"))[path]
    assert isinstance(array, zarr.Array)
    rows = array.shape[0]
    if rng.random() < 0.15:
        tamper(dataset, path, 0, rows=max(0, rows + one_of((-1, 1, -rows, 300), rng)))
    elif rows:
        tamper(dataset, path, int(rng.integers(rows)), one_of(odd_values(path, array), rng))
    return _reading(rng)


def spoil_attributes(folder: Path, rng: np.random.Generator) -> list[list[str]]:
    """The attributes of a group, sealed again; returns what is to be read."""
    repository = GraspRepository.open(folder / "grasps")
    branch = one_of(("main", "main", "main", "handsight.releases"), rng)
    transaction = repository.writable(branch)
    root = zarr.open_group(transaction.store, mode="r+")
    # Zarr lists them in the order in which they were read, which differs.
    members = sorted(root.members(max_depth=None), key=lambda member: member[0])
    groups = [root, *(node for _, node in members if isinstance(node, zarr.Group))]
    group = one_of([one for one in groups if one.attrs.asdict()], rng)
    changed = json.loads(json.dumps(mutate_json(group.attrs.asdict(), rng), allow_nan=True, default=str))
    if not isinstance(changed, dict):
        return _reading(rng)
    try:
        group.attrs.put(resealed(changed) if group.path.startswith("sessions/") else changed)
        repository.commit(transaction, branch=branch, message="tamper")
    except (ValueError, TypeError, RecursionError, icechunk.IcechunkError):
        # Zarr or Icechunk do not write it.
        return _reading(rng)
    return [*_reading(rng), ["release", "v2"], ["branch", "other"]]


_SEALED = {
    "provenance_digest": ("header", "config_digest", "code", "packages", "started"),
    "status_digest": ("status", "ended"),
}


def resealed(attributes: dict[str, Any]) -> dict[str, Any]:
    """The attributes of a session with digests that belong to them."""
    digests = {
        name: hashlib.sha256(canonical_json({one: attributes.get(one) for one in covered}).encode()).hexdigest()
        for name, covered in _SEALED.items()
        if name in attributes
    }
    return {**attributes, **digests}


def _reading(rng: np.random.Generator) -> list[list[str]]:
    return [list(READING[at]) for at in rng.permutation(len(READING))[:2]]


def spoil_metadata(folder: Path, rng: np.random.Generator) -> list[list[str]]:
    """A decision, a filter or folds under odd names and reasons; returns what is to be read."""
    word = one_of((*ODD_WORDS, mutate_text("left-hand", rng)), rng)
    dataset = str(folder / "grasps")
    kinds = (
        ("dataset", "filter", "--where=success == 1", "--", dataset, word),
        ("dataset", "exclude", dataset, "0", f"--reason={word}"),
        ("dataset", "exclude", dataset, "0", "--reason=dark", f"--author={word}"),
        ("dataset", "folds", "--by=object", "-k2", "--", dataset, word),
        ("dataset", "release", "--", dataset, word),
        ("dataset", "branch", "--", dataset, word),
    )
    command(*one_of(kinds, rng))
    return [["info"], ["log"], *_reading(rng)[:1]]


def spoil_mesh(suffix: str, folder: Path, rng: np.random.Generator) -> None:
    """Text as text, and the description of a glb as a tree."""
    path = one_of(sorted((folder / "meshes").glob(f"*.{suffix}")), rng)
    content = path.read_bytes()
    if suffix in ("obj", "mtl") or path.name.startswith("two."):
        path.write_text(mutate_text(content.decode(), rng), errors="replace")
    elif suffix == "glb" and rng.random() < 0.7:
        size = int.from_bytes(content[12:16], "little")
        text = mutate_json_text(content[20 : 20 + size].decode(), rng).encode(errors="replace")
        text += b" " * (-len(text) % 4)
        rest = len(text).to_bytes(4, "little") + content[16:20] + text + content[20 + size :]
        path.write_bytes(content[:8] + (12 + len(rest)).to_bytes(4, "little") + rest)
    else:
        path.write_bytes(mutate_bytes(content, rng))
