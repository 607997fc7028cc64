"""Import of a LeRobotDataset that handsight exported; ``lerobot_layout`` says what it looks like."""

from __future__ import annotations

import json
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from handsight.datasets.errors import CorruptDataError, DatasetError, InterchangeError, counted, headline
from handsight.datasets.exchange.bundle import (
    Bundle,
    decisions_from_json,
    refuse_changed,
    refuse_linked,
    schema_of_origin,
)
from handsight.datasets.exchange.foreign import NOT_UNDERSTOOD, guarded
from handsight.datasets.exchange.lerobot_edits import Recorded, edits_of
from handsight.datasets.exchange.lerobot_layout import (
    EPISODES_PER_FILE,
    SIDE,
    data_file,
    depth_key,
    depth_of_mm,
    flat_name,
    rgb_key,
    valid_key,
)
from handsight.datasets.exchange.parquet_rows import RowReader
from handsight.datasets.exchange.pictures import decoded
from handsight.datasets.exchange.sources import SessionSource, checked_source
from handsight.datasets.format.rows import from_row
from handsight.datasets.format.schema import COLUMNS, VIEWPOINTS, Viewpoint, attempt_id, column_widths
from handsight.datasets.format.typed import shown
from handsight.datasets.format.upgrades import columns_of, current_attributes, empty_columns
from handsight.datasets.machine import of_the_machine
from handsight.datasets.records import GraspAttempt, RgbdFrame, StationSpec

_UNPACKING = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, tokenize.TokenError, SyntaxError)
"""What ``zipfile`` and NumPy, which takes the header of an array for Python, raise besides of damaged bytes and of
encrypted ones."""

_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def recognises(path: Path) -> bool:
    """Whether the path is a folder with a LeRobotDataset."""
    return path.is_dir() and (path / "meta" / "info.json").is_file()


@contextmanager
def open_bundle(path: Path) -> Iterator[Bundle]:
    """Open a folder for import. Only what handsight exported holds what an attempt needs.

    Raises:
        InterchangeError: The folder was not exported by handsight, is newer, or holds links.
    """
    refuse_linked(path)
    try:
        origin = json.loads((path / SIDE / "origin.json").read_text())
        schema = schema_of_origin(origin, path)
        files = [file for file in (path / SIDE).glob("*.npz") if not file.name.startswith("._")]  # Of macOS.
        ulids = sorted(file.stem for file in files)
        rows = _rows_in_data(path)
        read = [_session(path, ulid, schema, rows) for ulid in ulids]
        sessions = [source for source, _ in read]
        refuse_changed(origin, sessions, path)
        decisions = decisions_from_json(origin["decisions"], path)
        edits = edits_of(path, [recorded for _, recorded in read])
    except DatasetError:
        raise
    except (*NOT_UNDERSTOOD, *_UNPACKING) as error:
        if trouble := of_the_machine(f"{path} cannot be read", error):
            raise trouble from error
        reason = f"{type(error).__name__}: {headline(error)}"
        raise InterchangeError(
            f"{path} lacks what handsight exports beside LeRobot's own files ({reason}): "
            "a LeRobotDataset of another origin does not say what its label is or where its camera was: describe it in "
            "a map and import it with --map map.toml, or make a table of its pictures (both in docs/datasets.md)"
        ) from error
    yield Bundle(sessions=guarded(sessions, path), decisions=decisions, edits=edits)


def _session(path: Path, ulid: str, schema: int, rows: int) -> tuple[SessionSource, Recorded]:
    """A session of an export, and what it holds beside LeRobot's own files."""
    described = json.loads((path / SIDE / f"{ulid}.json").read_text())
    attributes = current_attributes(described["attributes"], schema)
    first = described["first_episode"]
    if not isinstance(first, int) or isinstance(first, bool) or not 0 <= first <= rows:
        raise InterchangeError(
            f"{path}: first_episode of session {ulid} is {shown(first)}, expected a whole number of 0 to {rows}"
        )
    with zipfile.ZipFile(path / SIDE / f"{ulid}.npz") as file:
        size = _shape(file, "attempts/number", "int64", path)[0]
        if size > rows:
            # Before any column is read: a few bytes suffice to claim any number of rows.
            raise InterchangeError(
                f"{path}: session {ulid} claims {counted(size, 'attempt')}, and the data have {counted(rows, 'row')}"
            )
        source = checked_source(ulid, attributes, size=size)
        columns = _columns(file, source, schema, path)
    source = replace(
        source,
        attempts=partial(_read_attempts, path, ulid, columns, first, source.header.station),
        digests=tuple(digest.tobytes() for digest in columns["attempts/digest"]),
    )
    return source, Recorded(ulid=ulid, size=size, first_episode=first, columns=columns)


def _columns(file: zipfile.ZipFile, source: SessionSource, schema: int, path: Path) -> dict[str, NDArray[Any]]:
    """The columns of a session by path in its group, as today's schema has them."""
    size, widths = source.size, column_widths(source.header)
    columns = {
        f"attempts/{one.name}": _array(file, f"attempts/{one.name}", one.dtype, (size, *one.shape(widths)), path)
        for one in columns_of(schema)
    }
    for viewpoint in VIEWPOINTS:
        name = f"{viewpoint}/pose_base_tool"
        columns[name] = _array(file, name, "float64", (size, 4, 4), path)
    return columns | {f"attempts/{name}": values for name, values in empty_columns(schema, size, widths).items()}


def _rows_in_data(path: Path) -> int:
    rows = 0
    for file in sorted(path.glob("data/*/*.parquet")):
        try:
            rows += pq.read_metadata(file).num_rows
        except (OSError, MemoryError, pa.ArrowException) as error:
            if trouble := of_the_machine(f"{file} cannot be read", error):
                raise trouble from error
            raise CorruptDataError(
                f"attempts cannot be read from {file}: {headline(error)}; take an undamaged copy"
            ) from error
    return rows


def _shape(file: zipfile.ZipFile, name: str, dtype: str, path: Path) -> tuple[int, ...]:
    """The shape that an array of a ``.npz`` claims."""
    with file.open(f"{flat_name(name)}.npy") as entry:
        shape, _, found = _HEADERS[np.lib.format.read_magic(entry)](entry)
    if found.hasobject:
        raise ValueError(f"column {name} is pickled")
    if found != np.dtype(dtype) or not shape:
        raise InterchangeError(f"{path}: column {name} in {file.filename} is {found} {shape}, expected {dtype}")
    return tuple(int(side) for side in shape)


def _array(file: zipfile.ZipFile, name: str, dtype: str, shape: tuple[int, ...], path: Path) -> NDArray[Any]:
    """An array whose type and shape are known, so that a file cannot ask for more memory than it should."""
    found = _shape(file, name, dtype, path)
    if found != shape:
        raise InterchangeError(f"{path}: column {name} in {file.filename} has shape {found}, expected {shape}")
    with file.open(f"{flat_name(name)}.npy") as entry:
        return np.asarray(np.lib.format.read_array(entry, allow_pickle=False))


def _read_attempts(
    path: Path, ulid: str, columns: dict[str, NDArray[Any]], first: int, station: StationSpec
) -> Iterator[GraspAttempt]:
    file, opened = None, ""
    for number in range(len(columns["attempts/number"])):
        episode = first + number
        name = data_file(episode)
        try:
            if name != opened:
                file, opened = RowReader(path / name), name
            assert file is not None
            row = file.row(episode % EPISODES_PER_FILE)
            pictures = {viewpoint: _rgbd_frame(row, viewpoint, columns, number, station) for viewpoint in VIEWPOINTS}
        except (OSError, KeyError, ValueError, IndexError, TypeError, MemoryError, pa.ArrowException) as error:
            if trouble := of_the_machine(f"{path / name} cannot be read", error):
                raise trouble from error
            raise CorruptDataError(
                f"attempt {attempt_id(ulid, number)} cannot be read from {path / name}: {headline(error)}; take an "
                "undamaged copy"
            ) from error
        values = {column.name: columns[f"attempts/{column.name}"][number] for column in COLUMNS}
        yield from_row(values, pictures)


def _rgbd_frame(
    row: dict[str, Any], viewpoint: Viewpoint, columns: dict[str, NDArray[Any]], number: int, station: StationSpec
) -> RgbdFrame | None:
    taken = bool(columns["attempts/picture_taken"][number, VIEWPOINTS.index(viewpoint)])
    if row.get(valid_key(viewpoint), taken) != taken:
        raise InterchangeError(f"{valid_key(viewpoint)} is {not taken}, and what was recorded says {taken}")
    if not taken:
        return None
    intrinsics = station.camera.intrinsics
    size = (intrinsics.height, intrinsics.width)
    pose = columns[f"{viewpoint}/pose_base_tool"][number]
    rgb = decoded(row[rgb_key(viewpoint)]["bytes"], size=size)
    if depth_key(viewpoint) in row:
        depth = depth_of_mm(decoded(row[depth_key(viewpoint)]["bytes"], size=size), station.depth_scale_m)
    else:
        # Older exports hold depth as it was recorded, as PNG of 16 bits.
        depth = decoded(row[f"{rgb_key(viewpoint)}_depth"]["bytes"], size=size)
    return RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=pose)
