"""What a dataset looks like on disk: groups, columns, chunks, codecs.

::

    /                               attrs: schema_version, dataset_uuid, created
    /sessions/<ulid>/               attrs: see sessions.py; one writer per group, so that commits never conflict
        overhead/rgb                u1 (N, H, W, 3)
        overhead/depth              u2 (N, H, W), 0 is invalid
        overhead/pose_base_tool     f8 (N, 4, 4)
                                    fill values where the picture was never taken
        pregrasp/...                the same
        attempts/<column>           (N, ...), the columns below

Row *n* of every array of a session belongs to attempt number *n*. Outside the session an attempt is known by its id
alone, which never changes. Every array ends its codecs with crc32c: blosc and zstd alone let most flipped bits pass.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import zarr
from zarr.abc.buffer import Buffer
from zarr.abc.codec import ArrayArrayCodec, BytesBytesCodec
from zarr.codecs import BloscCodec, Crc32cCodec, TransposeCodec, ZstdCodec
from zarr.codecs.numcodecs import Delta
from zarr.storage import MemoryStore

from handsight.datasets.errors import AttemptNotFoundError
from handsight.datasets.format.arrays import Layouts, array_at, run_concurrently
from handsight.datasets.records import PHASES, SessionHeader

SCHEMA_VERSION = 2
"""Written to every new dataset; a dataset with a larger number is refused."""

Viewpoint = Literal["overhead", "pregrasp"]
VIEWPOINTS: tuple[Viewpoint, ...] = get_args(Viewpoint)
"""The pictures an attempt can have, in the order in which they are taken."""

SESSIONS = "sessions"
"""Group that holds one group for each session."""

FAILURE_BYTES = 512
"""Longest failure text, in bytes of UTF-8. Zero padding compresses to nothing."""

COLUMN_CHUNK_ROWS = 256
"""Rows in one chunk of a column while it is recorded: few, because a commit rewrites the last one. Pictures have one
frame in each chunk."""

PACKED_CHUNK_ROWS = 16384
"""Rows in one chunk of a column of a sealed session that has more than ``COLUMN_CHUNK_ROWS`` attempts: many, because
reading costs a millisecond for each chunk."""


class ColumnWidths(NamedTuple):
    """Places in one row of the columns whose width differs between sessions."""

    objects: int
    conditions: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One value, or one small array, for each attempt."""

    name: str
    dtype: str
    shape: Callable[[ColumnWidths], tuple[int, ...]] = lambda widths: ()
    """Shape of one row, from the widths of the session."""
    axes: tuple[str, ...] = ()
    """Names of the axes of one row."""
    unit: str = ""
    fill: float | int | bool = 0
    """What a slot holds that belongs to nothing, such as the second object of a scene with one."""
    digested: bool = True
    """Whether the value is content; ids and clock times are not."""
    since: int = 1
    """Schema version that brought the column. Where it holds nothing it stays out of the digest, so that attempts of
    older datasets keep theirs."""
    description: str


_NAN = float("nan")

COLUMNS = (
    Column(name="number", dtype="int64", digested=False, description="Position in the session, from 0."),
    Column(name="outcome", dtype="uint8", description="Outcome: 0 empty, 1 held, 2 unreachable, 3 aborted."),
    Column(
        name="failure",
        dtype="uint8",
        shape=lambda widths: (FAILURE_BYTES,),
        axes=("failure_byte",),
        description="'phase: reason' in UTF-8, padded with zeros; empty where the attempt ran to its end.",
    ),
    Column(
        name="picture_taken",
        dtype="bool",
        shape=lambda widths: (len(VIEWPOINTS),),
        axes=("viewpoint",),
        fill=False,
        description=f"Whether there is a picture: {', '.join(VIEWPOINTS)}.",
    ),
    Column(
        name="pregrasp_x_y_angle",
        dtype="float64",
        shape=lambda widths: (3,),
        axes=("x_y_angle",),
        unit="m, m, rad",
        fill=_NAN,
        description="The pre-grasp pose commanded, in the base frame.",
    ),
    Column(
        name="predicted_success",
        dtype="float64",
        since=2,
        fill=_NAN,
        description="Success that the network which chose the pre-grasp pose expected; NaN where none did.",
    ),
    Column(
        name="pose_base_tool_grasp",
        dtype="float64",
        shape=lambda widths: (4, 4),
        axes=("pose_row", "pose_column"),
        unit="m",
        fill=_NAN,
        description="Tool pose measured when the jaws closed; NaN when they did not.",
    ),
    Column(
        name="contact_force_n",
        dtype="float64",
        unit="N",
        fill=_NAN,
        description="Upward force that ended the descent; 0 when it ended at table height.",
    ),
    Column(
        name="gripper_width_m",
        dtype="float64",
        shape=lambda widths: (4,),
        axes=("grasp_stage",),
        unit="m",
        fill=_NAN,
        description="Jaw opening before, closed, lifted and final; NaN where the attempt never got there.",
    ),
    Column(name="object_count", dtype="int16", fill=-1, description="Objects in the scene; -1 where unknown."),
    Column(name="target", dtype="int16", fill=-1, description="Which object the pose was drawn around; -1 unknown."),
    Column(
        name="catalogue_index",
        dtype="int16",
        shape=lambda widths: (widths.objects,),
        axes=("object",),
        fill=-1,
        digested=False,
        description="Index of each object in the session's catalogue. The digest takes the names instead.",
    ),
    Column(
        name="pose_base_object",
        dtype="float64",
        shape=lambda widths: (widths.objects, 7),
        axes=("object", "position_quaternion"),
        unit="m, 1",
        fill=_NAN,
        description="Position and quaternion, as x y z qx qy qz qw, when the overhead picture was taken.",
    ),
    Column(
        name="conditions",
        dtype="float64",
        since=2,
        shape=lambda widths: (widths.conditions,),
        axes=("condition",),
        fill=_NAN,
        description="Values of the session's named conditions, varied from attempt to attempt.",
    ),
    Column(name="truth_held", dtype="int8", fill=-1, description="Simulator truth: 0, 1, or -1 where there is none."),
    Column(
        name="phase_s",
        dtype="float32",
        shape=lambda widths: (len(PHASES),),
        axes=("phase",),
        unit="s",
        fill=_NAN,
        description=f"Duration of {', '.join(PHASES)} in the station's own time.",
    ),
    Column(
        name="started_elapsed_ns",
        dtype="int64",
        shape=lambda widths: (2,),
        axes=("start_duration",),
        unit="ns",
        digested=False,
        description="Wall clock at the start, since the epoch, and wall time taken.",
    ),
    Column(
        name="digest",
        dtype="uint8",
        shape=lambda widths: (32,),
        axes=("digest_byte",),
        digested=False,
        description="SHA-256 of the attempt's content, see digest.py.",
    ),
)
"""Everything of an attempt but its pictures. Values that are read together share a column: a commit costs a few
milliseconds for each array it touches."""


def column_widths(header: SessionHeader) -> ColumnWidths:
    """The widths of a session; at least one of each kind, because an array cannot have chunks of no width."""
    return ColumnWidths(objects=max(1, header.objects_per_scene), conditions=max(1, len(header.station.conditions)))


def packed_rows(status: str, attempts: int) -> int:
    """Rows in one chunk of a column, from the status of the session and its size."""
    return PACKED_CHUNK_ROWS if status == "sealed" and attempts > COLUMN_CHUNK_ROWS else COLUMN_CHUNK_ROWS


MOST_DIGITS = 19
"""Of an attempt's number. Python itself refuses to read a few thousand."""


def attempt_id(session: str, number: int) -> str:
    """The id of an attempt: its session's ULID and its number."""
    return f"{session}-{number:06d}"


def attempt_ids(session: str, numbers: Iterable[int]) -> list[str]:
    """The ids of attempts of one session; for a million of them, twice as fast as :func:`attempt_id` for each."""
    prefix = f"{session}-"
    return [f"{prefix}{number:06d}" for number in numbers]


def parse_attempt_id(text: str) -> tuple[str, int]:
    """Split an attempt id into session and number.

    Raises:
        AttemptNotFoundError: The text is no attempt id.
    """
    session, _, digits = text.rpartition("-")
    number = attempt_number(digits)
    if not session or number is None or attempt_id(session, number) != text:
        raise AttemptNotFoundError(f"attempt id is {text!r}, expected SESSION-NUMBER such as {attempt_id('01K…', 7)}")
    return session, number


def attempt_number(digits: str) -> int | None:
    """The number that a text writes; None where it is none, or longer than a number of 64 bits (see ``keys``)."""
    if not (digits.isascii() and digits.isdigit()) or len(digits) > MOST_DIGITS:
        return None
    return int(digits)


_FRAME_AXES = {
    "rgb": ("row", "column", "colour"),
    "depth": ("row", "column"),
    "pose_base_tool": ("pose_row", "pose_column"),
}

SESSION_AXES: dict[str, tuple[str, ...]] = {
    **{f"{viewpoint}/{name}": ("attempt", *axes) for viewpoint in VIEWPOINTS for name, axes in _FRAME_AXES.items()},
    **{f"attempts/{column.name}": ("attempt", *column.axes) for column in COLUMNS},
}
"""Names of the axes of every array of a session, by its path in the session's group."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlankSession:
    """What a session without attempts consists of, but for its own attributes."""

    documents: Mapping[str, Buffer]
    """Everything that is stored, by key; groups before what is in them."""
    layouts: Layouts


def blank_session(header: SessionHeader, *, column_rows: int = COLUMN_CHUNK_ROWS) -> BlankSession:
    """The arrays of a session that begins, as they are to be created, with ``column_rows`` rows in a chunk of a column.

    Zarr takes 2 ms to work out what an array is stored as, and there are two dozen; so that is done once for all
    sessions of the same widths.
    """
    intrinsics = header.station.camera.intrinsics
    return _blank(intrinsics.height, intrinsics.width, *column_widths(header), column_rows)


def create_arrays(session: zarr.Group, header: SessionHeader, *, column_rows: int = COLUMN_CHUNK_ROWS) -> None:
    """Create the empty arrays of a session, with ``column_rows`` rows in one chunk of a column."""
    documents = blank_session(header, column_rows=column_rows).documents
    groups = {key: value for key, value in documents.items() if key.count("/") == 1}
    for some in (groups, {key: value for key, value in documents.items() if key not in groups}):
        run_concurrently((session.store_path / key).set(value) for key, value in some.items())


@lru_cache(maxsize=64, typed=True)
def _blank(height: int, width: int, objects: int, conditions: int, column_rows: int) -> BlankSession:
    documents: dict[str, Buffer] = {}
    session = zarr.open_group(MemoryStore(documents), mode="w", zarr_format=3)
    for viewpoint in VIEWPOINTS:
        group = session.create_group(viewpoint)
        create_rgb(group, "rgb", frame=(height, width))
        create_depth(group, "depth", frame=(height, width))
        pose = {"unit": "m"}
        axes = ("attempt", *_FRAME_AXES["pose_base_tool"])
        kept: dict[str, Any] = {"rows": column_rows, "fill": _NAN, "attributes": pose}
        create_array(group, "pose_base_tool", dtype="float64", row=(4, 4), axes=axes, **kept)
    attempts = session.create_group("attempts")
    for column in COLUMNS:
        create_column(attempts, column, ColumnWidths(objects, conditions), rows=column_rows)
    del documents["zarr.json"]
    return BlankSession(documents=documents, layouts={path: array_at(session, path).metadata for path in SESSION_AXES})


def create_column(attempts: zarr.Group, column: Column, widths: ColumnWidths, *, rows: int) -> None:
    """Create a column without rows in the group ``attempts`` of a session, with ``rows`` rows in a chunk."""
    create_array(
        attempts,
        column.name,
        dtype=column.dtype,
        row=column.shape(widths),
        axes=("attempt", *column.axes),
        rows=rows,
        fill=column.fill,
        attributes={"unit": column.unit, "description": column.description},
    )


def create_rgb(group: zarr.Group, name: str, *, frame: tuple[int, int]) -> None:
    """Create an array of colour pictures, one in each chunk, as differences between neighbouring pixels of a row.

    As small as PNG and quicker to write (decision 010). All of it is in the array's own metadata, so zarr alone reads
    it. Frames one pixel wide or high are stored as they are: ``Delta`` flattens those in another order than it
    restores them.
    """
    filters: tuple[ArrayArrayCodec, ...] = ()
    if min(frame) > 1:
        # Each row's reds, then its greens, then its blues. Signed differences have the same bits as unsigned ones,
        # and NumPy sums them up four times as fast.
        filters = (TransposeCodec(order=(0, 1, 3, 2)), Delta(dtype="|i1"))
    compressor = ZstdCodec(level=1)
    _create(
        group,
        name,
        dtype="uint8",
        chunk=(1, *frame, 3),
        axes=("attempt", *_FRAME_AXES["rgb"]),
        filters=filters,
        compressor=compressor,
    )


def create_depth(group: zarr.Group, name: str, *, frame: tuple[int, int]) -> None:
    """Create an array of depth pictures, one in each chunk: all high bytes, then all low bytes (decision 010)."""
    height, width = frame
    # One block for the whole frame: what repeats is found wherever it was before.
    blosc = BloscCodec(typesize=2, cname="zstd", clevel=1, shuffle="shuffle", blocksize=2 * height * width)
    unit = {"unit": "depth_scale_m"}
    _create(
        group,
        name,
        dtype="uint16",
        chunk=(1, *frame),
        axes=("attempt", *_FRAME_AXES["depth"]),
        compressor=blosc,
        attributes=unit,
    )


def create_array(
    group: zarr.Group,
    name: str,
    *,
    dtype: str,
    row: tuple[int, ...],
    axes: Sequence[str],
    rows: int = COLUMN_CHUNK_ROWS,
    fill: float | int | bool = 0,
    attributes: dict[str, Any] | None = None,
) -> None:
    """Create an array without rows: compressed without loss, checksummed, ``rows`` rows of shape ``row`` in a chunk.

    ``axes`` names every axis, that of the rows first. Within a group one name stands for one length, and none is that
    of an array with several axes: xarray wants it so.
    """
    blosc = BloscCodec(typesize=np.dtype(dtype).itemsize, cname="zstd", clevel=3, shuffle="shuffle")
    _create(group, name, dtype=dtype, chunk=(rows, *row), axes=axes, compressor=blosc, fill=fill, attributes=attributes)


def _create(
    group: zarr.Group,
    name: str,
    *,
    dtype: str,
    chunk: tuple[int, ...],
    axes: Sequence[str],
    compressor: BytesBytesCodec,
    filters: tuple[ArrayArrayCodec, ...] = (),
    fill: float | int | bool = 0,
    attributes: dict[str, Any] | None = None,
) -> None:
    group.create_array(
        name,
        shape=(0, *chunk[1:]),
        chunks=chunk,
        dtype=dtype,
        filters=filters,
        compressors=(compressor, Crc32cCodec()),
        fill_value=fill,
        dimension_names=axes,
        attributes=attributes,
    )
