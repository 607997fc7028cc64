"""Proof that stored bytes are those that were recorded.

Every chunk carries a crc32c, so most damage shows when it is decoded. What is decoded is then hashed again and
compared with the digest recorded with the attempt, which also finds pictures that were swapped, rows that were moved
and anything that was changed with its checksum. Ids and clocks, which the digest leaves out, are covered by the
checksum alone.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from handsight.datasets.arrays import READ_FAILURES, array_at, group_at, read_rows
from handsight.datasets.blocks import column_paths
from handsight.datasets.digest import attempt_digest
from handsight.datasets.errors import CorruptDataError
from handsight.datasets.folds import FOLDS
from handsight.datasets.overlay import CURATION
from handsight.datasets.reader import GraspDataset
from handsight.datasets.records import Snapshot
from handsight.datasets.rows import Row, from_row
from handsight.datasets.saved_views import VIEWS_GROUP
from handsight.datasets.schema import COLUMNS, SESSIONS, VIEWS, Slots, View, attempt_id
from handsight.datasets.sessions import SessionInfo, attribute_damage

_TASK_ROWS = 64
"""Attempts that a thread takes at a time."""

_BLOCK_FRAMES = 8
"""Frames decoded together; about 25 MB for two views at 640x480."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifyReport:
    """What a verification found."""

    checked: int
    """Attempts whose every byte was read."""
    bytes: int
    """Bytes of pictures and columns that were hashed, uncompressed."""
    faults: dict[str, str]
    """Why an attempt is corrupt, by its id."""
    damage: tuple[str, ...]
    """Damage to what belongs to no single attempt: session headers, curation, folds, views."""

    @property
    def corrupt(self) -> tuple[str, ...]:
        """Ids of the corrupt attempts, in the order of the table."""
        return tuple(self.faults)

    @property
    def ok(self) -> bool:
        """Whether every byte is as it was recorded."""
        return not self.faults and not self.damage


@dataclass(slots=True, kw_only=True)
class _Task:
    """Some neighbouring attempts of one session, and what is found of them."""

    session: SessionInfo
    group: zarr.Group
    start: int
    stop: int
    columns: dict[str, NDArray[Any]]
    """Their rows of every column by its path in the group; empty where these are damaged."""
    bytes: int = 0
    faults: dict[int, str] = field(default_factory=dict)
    """By number."""


def verify(
    dataset: GraspDataset, *, jobs: int | None = None, on_checked: Callable[[int], None] | None = None
) -> VerifyReport:
    """Read every byte of a version and name the attempts whose bytes are not those recorded.

    Args:
        dataset: The version to check.
        jobs: Threads; as many as cores unless given.
        on_checked: Called with the number of attempts checked so far.

    Raises:
        CorruptDataError: The list of sessions itself cannot be read.
        ForkedProcessError: The dataset was opened in another process.
    """
    root = dataset.repository.root(dataset.snapshot_id)
    tasks = (task for session in dataset.sessions for task in _tasks(root, session))
    checked = size = 0
    faults: dict[str, str] = {}
    for task in _in_threads(tasks, jobs or os.cpu_count() or 1):
        size += task.bytes
        checked += task.stop - task.start
        faults |= {attempt_id(task.session.ulid, number): why for number, why in sorted(task.faults.items())}
        if on_checked is not None:
            on_checked(checked)
    return VerifyReport(checked=checked, bytes=size, faults=faults, damage=tuple(_damage_beside(root)))


def _in_threads(tasks: Iterator[_Task], jobs: int) -> Iterator[_Task]:
    """The tasks in their order, each checked; few are begun ahead, because they hold their columns."""
    with ThreadPoolExecutor(max_workers=jobs) as pool:
        begun: deque[Future[_Task]] = deque()
        for task in tasks:
            begun.append(pool.submit(_check, task))
            if len(begun) > 2 * jobs:
                yield begun.popleft().result()
        while begun:
            yield begun.popleft().result()


def _tasks(root: zarr.Group, session: SessionInfo) -> Iterator[_Task]:
    """Columns are read by whole chunks, once, and shared out."""
    group = group_at(root, f"{SESSIONS}/{session.ulid}")
    rows = array_at(group, "attempts/number").chunks[0]
    for first in range(0, session.attempts, rows):
        last = min(first + rows, session.attempts)
        try:
            columns = {path: _rows(array_at(group, path), first, last) for path in column_paths()}
        except CorruptDataError as error:
            yield _damaged_task(session, group, first, last, str(error))
            continue
        for start in range(first, last, _TASK_ROWS):
            stop = min(start + _TASK_ROWS, last)
            own = {path: values[start - first : stop - first] for path, values in columns.items()}
            yield _Task(session=session, group=group, start=start, stop=stop, columns=own)


def _damaged_task(session: SessionInfo, group: zarr.Group, start: int, stop: int, fault: str) -> _Task:
    faults = dict.fromkeys(range(start, stop), fault)
    return _Task(session=session, group=group, start=start, stop=stop, columns={}, faults=faults)


def _check(task: _Task) -> _Task:
    if task.columns:
        for start in range(task.start, task.stop, _BLOCK_FRAMES):
            _check_block(task, start, min(start + _BLOCK_FRAMES, task.stop))
    return task


def _check_block(task: _Task, start: int, stop: int) -> None:
    try:
        pictures = {view: _pictures(task, view, start, stop) for view in VIEWS}
    except CorruptDataError as error:
        if stop - start > 1:
            for number in range(start, stop):
                _check_block(task, number, number + 1)
        else:
            task.faults[start] = str(error)
        return
    for number in range(start, stop):
        row = {column.name: task.columns[f"attempts/{column.name}"][number - task.start] for column in COLUMNS}
        taken = dict(zip(VIEWS, row["picture_taken"], strict=True))
        snapshots = {view: pictures[view][number - start] if taken[view] else None for view in VIEWS}
        fault = _fault(task.session, number, row, snapshots)
        if fault:
            task.faults[number] = fault
        task.bytes += sum(values.nbytes for values in row.values())
        task.bytes += sum(one.rgb.nbytes + one.depth.nbytes for one in snapshots.values() if one is not None)


def _fault(session: SessionInfo, number: int, row: Row, snapshots: Mapping[View, Snapshot | None]) -> str | None:
    if int(row["number"]) != number:
        return f"row {number} holds the number {int(row['number'])}"
    try:
        found = attempt_digest(from_row(row, snapshots), session.header.station)
    except (ValueError, IndexError) as error:
        return f"its values make no attempt: {error}"
    recorded = row["digest"].tobytes()
    if found != recorded:
        return f"its content has digest {found.hex()[:16]}…, recorded was {recorded.hex()[:16]}…"
    return None


def _pictures(task: _Task, view: View, start: int, stop: int) -> list[Snapshot]:
    rgb, depth = (_rows(array_at(task.group, f"{view}/{name}"), start, stop) for name in ("rgb", "depth"))
    poses = task.columns[f"{view}/pose_base_tool"][start - task.start : stop - task.start]
    return [Snapshot(rgb=rgb[at], depth=depth[at], pose_base_tool=poses[at]) for at in range(stop - start)]


def _rows(array: zarr.Array[Any], start: int, stop: int) -> NDArray[Any]:
    rows = read_rows(array, start, stop)
    if len(rows) != stop - start:
        raise CorruptDataError(f"{array.path} ends at row {array.shape[0]}, expected at least {stop}")
    return rows


def _damage_beside(root: zarr.Group) -> Iterator[str]:
    """Reads what the dataset holds beside its attempts: how sessions are described, curation, views, folds."""
    try:
        for ulid, session in sorted(group_at(root, SESSIONS).groups()):
            yield from (f"session {ulid}: {fault}" for fault in _session_faults(session))
        for name in sorted(set(root.group_keys()) - {SESSIONS}):
            if name not in (CURATION, FOLDS, VIEWS_GROUP):
                yield f"there is a group {name!r}, which handsight does not make"
            for _, node in sorted(group_at(root, name).members(max_depth=None)):
                if isinstance(node, zarr.Array):
                    read_rows(node, 0, node.shape[0])
    except READ_FAILURES as error:
        yield str(error)


def _session_faults(group: zarr.Group) -> list[str]:
    """Attributes that changed, and columns that are not laid out as the schema says: their bytes would be misread."""
    faults = attribute_damage(group.attrs.asdict())
    slots = Slots(*(array_at(group, f"attempts/{name}").shape[1] for name in ("catalogue_index", "conditions")))
    for column in COLUMNS:
        array = array_at(group, f"attempts/{column.name}")
        found = (array.dtype, array.shape[1:], np.array(array.fill_value, array.dtype).tobytes())
        dtype = np.dtype(column.dtype)
        if found != (dtype, column.shape(slots), np.array(column.fill, dtype).tobytes()):
            faults.append(
                f"column {column.name} has type {array.dtype}, rows of {array.shape[1:]}, fill value "
                f"{array.fill_value}; expected {dtype}, {column.shape(slots)}, {column.fill}"
            )
    return faults
