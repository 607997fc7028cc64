"""Export to HDF5 and import of what was exported; ``hdf5_layout`` says what the file looks like."""

from __future__ import annotations

import errno
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import zarr
from numpy.typing import NDArray

from handsight.datasets.errors import CorruptDataError, InterchangeError, counted, headline
from handsight.datasets.exchange.bundle import (
    Bundle,
    decisions_from_json,
    decisions_to_json,
    origin_of,
    refuse_changed,
    schema_of_origin,
)
from handsight.datasets.exchange.foreign import guarded, understood
from handsight.datasets.exchange.hdf5_edits import edits_of
from handsight.datasets.exchange.hdf5_file import new_hdf5_file
from handsight.datasets.exchange.hdf5_layout import DATA, MASKS, UNLABELLED, demo_named, demo_names, group_of_demo
from handsight.datasets.exchange.hdf5_probe import refuse_unreadable
from handsight.datasets.exchange.sources import SessionSource, checked_source, stored_sources
from handsight.datasets.format.arrays import array_at, group_at, read_range
from handsight.datasets.format.rows import frame_of, from_row
from handsight.datasets.format.schema import COLUMNS, SESSIONS, VIEWPOINTS, Viewpoint, attempt_id, column_widths
from handsight.datasets.format.upgrades import columns_of, current_attributes, empty_columns
from handsight.datasets.machine import of_the_machine
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import GraspAttempt, RgbdFrame, SessionHeader

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_LOCKED = (errno.EAGAIN, errno.EWOULDBLOCK)
_MOST_TEXT_BYTES = 2**24
_PACKING = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
"""Lossless. Higher levels take several times as long for a few per cent."""


def recognises(path: Path) -> bool:
    """Whether the path is an HDF5 file."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(_SIGNATURE)) == _SIGNATURE


def write(dataset: GraspDataset, path: Path, on_attempt: Callable[[], None]) -> None:
    """Write a version to a new file."""
    root = dataset.root
    excluded = set(dataset.overlay.exclusions.index)
    masks: dict[str, list[str]] = {key: [] for key in MASKS}
    demo = 0
    with new_hdf5_file(path) as new:
        file = new.root
        file.attrs["handsight"] = json.dumps(origin_of(dataset))
        file["decisions"] = decisions_to_json(dataset.overlay.decisions)
        for group in (DATA, UNLABELLED, SESSIONS):
            file.create_group(group)
        for source in stored_sources(root):
            _write_session(file, source, group_at(root, f"{SESSIONS}/{source.ulid}/attempts"), first_demo=demo)
            for attempt in source.attempts():
                name, identity = f"demo_{demo}", attempt_id(source.ulid, attempt.number)
                group = group_of_demo(labelled=attempt.labelled)
                _write_demo(file[group].create_group(name), attempt, identity)
                masks["labelled"] += [name] if group == DATA else []
                masks["excluded"] += [name] if group == DATA and identity in excluded else []
                demo += 1
                new.check()
                on_attempt()
        file[DATA].attrs["total"] = len(masks["labelled"])
        file[DATA].attrs["env_args"] = json.dumps({"env_name": "handsight", "type": 2, "env_kwargs": {}})
        for key, names in masks.items():
            file[f"mask/{key}"] = np.array(names, dtype="S")


@contextmanager
def open_bundle(path: Path) -> Iterator[Bundle]:
    """Open a file for import.

    Raises:
        InterchangeError: The file is truncated, foreign, newer, changed, open elsewhere, or holds links.
        StorageError: It cannot be read.
    """
    refuse_unreadable(path)
    with _opened(path) as file:
        with understood(path, "was not exported by handsight, or is damaged"):
            _refuse_links(file, path, set())
            origin = json.loads(file.attrs.get("handsight", "{}"))
            schema = schema_of_origin(origin, path)
            sessions = [_source(file, ulid, path, schema) for ulid in sorted(_group(file, SESSIONS, path))]
            refuse_changed(origin, sessions, path)
            decisions = decisions_from_json(_text(file, "decisions", path), path)
            edits = edits_of(file, sessions, decisions, path.name)
        yield Bundle(sessions=guarded(sessions, path), decisions=decisions, edits=edits)


def _opened(path: Path) -> h5py.File:
    try:
        return h5py.File(path, "r")
    except OSError as error:
        if error.errno in _LOCKED:
            raise InterchangeError(f"{path} is open for writing in another program: close it there") from error
        if trouble := of_the_machine(f"{path} cannot be read", error):
            raise trouble from error
        if "already open for write" in str(error) or "consistency flags" in str(error):
            raise InterchangeError(
                f"{path} was not closed by the program that wrote it: close it there, or if that has ended without "
                f"closing it, run 'h5clear -s {path}' and check what it holds"
            ) from error
        raise InterchangeError(
            f"{path} cannot be opened as HDF5 ({headline(error)}): take an undamaged copy"
        ) from error


def _write_session(file: h5py.File, source: SessionSource, attempts: zarr.Group, *, first_demo: int) -> None:
    group = file.create_group(f"{SESSIONS}/{source.ulid}")
    group.attrs["first_demo"] = first_demo
    group["attributes"] = json.dumps(source.attributes)
    for column in COLUMNS:
        values = read_range(array_at(attempts, column.name), 0, source.size)
        group.create_dataset(f"columns/{column.name}", data=values, **(_PACKING if values.size else {}))


def _write_demo(demo: h5py.Group, attempt: GraspAttempt, identity: str) -> None:
    demo.attrs["num_samples"] = 1
    demo.attrs["attempt"] = identity
    action = (attempt.pregrasp_x_m, attempt.pregrasp_y_m, attempt.pregrasp_angle_rad)
    demo["actions"] = np.array([action])
    demo["rewards"] = np.array([float(attempt.success)])
    demo["dones"] = np.array([1])
    observations = demo.create_group("obs")
    for viewpoint in VIEWPOINTS:
        frame = frame_of(attempt, viewpoint)
        if frame is not None:
            for name in ("rgb", "depth"):
                pixels = getattr(frame, name)[None]
                observations.create_dataset(f"{viewpoint}_{name}", data=pixels, chunks=pixels.shape, **_PACKING)
            observations[f"{viewpoint}_pose_base_tool"] = frame.pose_base_tool[None]


def _source(file: h5py.File, ulid: str, path: Path, schema: int) -> SessionSource:
    group = _group(file, f"{SESSIONS}/{ulid}", path)
    attributes = current_attributes(json.loads(_text(group, "attributes", path)), schema)
    _group(file, DATA, path)
    size, demos = len(group["columns/number"]), sum(map(len, demo_names(file).values()))
    if size > demos:
        # Before any column is read: a few bytes suffice to claim any number of rows.
        raise InterchangeError(
            f"{path}: session {ulid} claims {counted(size, 'attempt')}, and the file has {counted(demos, 'demo')}"
        )
    source = checked_source(ulid, attributes, size=size)
    widths = column_widths(source.header)
    columns = {
        column.name: _array(group, f"columns/{column.name}", column.dtype, (size, *column.shape(widths)), path)
        for column in columns_of(schema)
    }
    columns |= empty_columns(schema, size, widths)
    return replace(
        source,
        attempts=partial(_read_attempts, file, source.header, columns, int(group.attrs["first_demo"]), ulid),
        digests=tuple(digest.tobytes() for digest in columns["digest"]),
    )


def _read_attempts(
    file: h5py.File, header: SessionHeader, columns: dict[str, NDArray[Any]], first_demo: int, ulid: str
) -> Iterator[GraspAttempt]:
    for number in range(len(columns["number"])):
        row = {name: values[number] for name, values in columns.items()}
        name = f"demo_{first_demo + number}"
        taken = dict(zip(VIEWPOINTS, row["picture_taken"], strict=True))
        try:
            demo = demo_named(file, name)
            if not isinstance(demo, h5py.Group) or demo.attrs["attempt"] != attempt_id(ulid, number):
                raise InterchangeError(f"{name} is missing, or is another attempt")
            pictures = {
                viewpoint: _frame(demo, viewpoint, header) if taken[viewpoint] else None for viewpoint in VIEWPOINTS
            }
        except (KeyError, OSError, RuntimeError, MemoryError, InterchangeError) as error:
            if trouble := of_the_machine(f"{file.filename} cannot be read", error):
                raise trouble from error
            raise CorruptDataError(
                f"attempt {attempt_id(ulid, number)} cannot be read from {file.filename}: {error}; "
                "take an undamaged copy"
            ) from error
        yield from_row(row, pictures)


def _frame(demo: h5py.Group, viewpoint: Viewpoint, header: SessionHeader) -> RgbdFrame:
    intrinsics = header.station.camera.intrinsics
    frame = (1, intrinsics.height, intrinsics.width)
    group = demo["obs"]
    return RgbdFrame(
        rgb=_array(group, f"{viewpoint}_rgb", "uint8", (*frame, 3), demo.name)[0],
        depth=_array(group, f"{viewpoint}_depth", "uint16", frame, demo.name)[0],
        pose_base_tool=_array(group, f"{viewpoint}_pose_base_tool", "float64", (1, 4, 4), demo.name)[0],
    )


def _group(file: h5py.File, name: str, where: object) -> h5py.Group:
    node = file.get(name)
    if not isinstance(node, h5py.Group):
        raise InterchangeError(f"{where} has no group {name}: it was not exported by handsight")
    return node


def _text(group: h5py.Group, name: str, where: object) -> str:
    """One text."""
    node = group.get(name)
    kind = h5py.check_string_dtype(node.dtype) if isinstance(node, h5py.Dataset) else None
    if kind is None or node.shape != () or (kind.length or 0) > _MOST_TEXT_BYTES:
        raise InterchangeError(f"{where}: {group.name}/{name} is no text, expected what handsight exports")
    return str(node.asstr()[()])


def _array(group: h5py.Group, name: str, dtype: str, shape: tuple[int, ...], where: object) -> NDArray[Any]:
    """A whole dataset whose type and shape are known, so that a file cannot ask for more memory than it should."""
    node = group.get(name)
    if not isinstance(node, h5py.Dataset) or node.dtype != np.dtype(dtype) or node.shape != shape:
        found = f"{node.dtype} {node.shape}" if isinstance(node, h5py.Dataset) else type(node).__name__
        raise InterchangeError(f"{where}: {name} is {found}, expected {dtype} {shape}")
    return np.asarray(node[()])


def _refuse_links(group: h5py.Group, path: Path, seen: set[int]) -> None:
    """Refuse whatever could reach outside the file, or round in circles inside it; ``seen`` is what was met so far."""
    for name in group:
        link = group.get(name, getlink=True)
        where = f"{group.name.rstrip('/')}/{name}"
        if not isinstance(link, h5py.HardLink):
            raise InterchangeError(f"{path} holds a link at {where}: links are not followed; remove it")
        node = group[name]
        place = h5py.h5o.get_info(node.id).addr
        if place in seen:
            raise InterchangeError(f"{path} holds {where} under another name too: keep one of the two")
        seen.add(place)
        if isinstance(node, h5py.Dataset) and (node.external or node.is_virtual):
            raise InterchangeError(f"{path} keeps the data of {where} in other files: repack it with h5repack")
        if isinstance(node, h5py.Group):
            _refuse_links(node, path, seen)
