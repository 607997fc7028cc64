"""Going back without losing anything: a new commit whose content is that of another version.

Icechunk can only move a branch back, which drops its later history. A revert copies instead: sessions that are not in
the wanted version are removed, those that differ get its rows from the first differing one on, and everything else of
the dataset (curation, filters, folds) becomes what it was. The cost grows with the difference, the commits in between
stay in the log, and a revert can itself be reverted.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.format.arrays import array_at, copy_group, group_at, read_all, read_rows
from handsight.datasets.format.frames import BATCH_FRAMES, frame_paths
from handsight.datasets.format.schema import SESSIONS
from handsight.datasets.store.layout import check_current
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.writing.batches import chunk_start, column_paths, rechunk_columns
from handsight.datasets.writing.change import change_root


def revert(repository: GraspRepository, ref: str, *, branch: str = DEFAULT_REF, message: str = "") -> str | None:
    """Make the content of a branch that of another version, in one commit, and return its snapshot id.

    Returns None when the branch has that content already. Nothing of the branch has to be readable but its arrays:
    this is the way out for one whose sessions cannot be opened any more.

    Raises:
        RefNotFoundError: There is no such ref or branch.
        CorruptDataError: What is to be copied is damaged.
    """
    wanted_id = repository.resolve(ref)
    wanted = repository.root(wanted_id)

    def change(snapshot_id: str, root: zarr.Group) -> tuple[str | None, None]:
        check_current(repository.path, branch, root)
        changed = _match_attributes(root, wanted)
        changed |= _match_sessions(group_at(root, SESSIONS), group_at(wanted, SESSIONS))
        for name in sorted({*root.group_keys(), *wanted.group_keys()} - {SESSIONS}):
            changed |= _match_group(root, wanted, name)
        return ((message or f"revert to {ref} ({wanted_id})") if changed else None), None

    return change_root(repository, branch, change).snapshot


def _match_attributes(group: zarr.Group, wanted: zarr.Group) -> bool:
    if group.attrs.asdict() == wanted.attrs.asdict():
        return False
    group.attrs.put(wanted.attrs.asdict())
    return True


def _match_group(parent: zarr.Group, wanted: zarr.Group, name: str) -> bool:
    """Replace a small group as a whole, where it differs."""
    if name in parent and name in wanted and _same_group(group_at(parent, name), group_at(wanted, name)):
        return False
    if name in parent:
        del parent[name]
    if name in wanted:
        copy_group(group_at(wanted, name), parent, name)
    return True


def _same_group(left: zarr.Group, right: zarr.Group) -> bool:
    if left.attrs.asdict() != right.attrs.asdict():
        return False
    nodes, others = dict(left.members(max_depth=None)), dict(right.members(max_depth=None))
    return nodes.keys() == others.keys() and all(_same_node(node, others[path]) for path, node in nodes.items())


def _same_node(left: zarr.Group | zarr.Array[Any], right: zarr.Group | zarr.Array[Any]) -> bool:
    if isinstance(left, zarr.Array) and isinstance(right, zarr.Array):
        return left.metadata == right.metadata and np.array_equal(_rows(left), _rows(right))
    return left.metadata == right.metadata


def _match_sessions(sessions: zarr.Group, wanted: zarr.Group) -> bool:
    changed = False
    for ulid in sorted({*sessions.group_keys(), *wanted.group_keys()}):
        if ulid not in wanted:
            del sessions[ulid]
        elif ulid not in sessions:
            copy_group(group_at(wanted, ulid), sessions, ulid)
        elif not _match_session(group_at(sessions, ulid), group_at(wanted, ulid)):
            continue
        changed = True
    return changed


def _match_session(session: zarr.Group, wanted: zarr.Group) -> bool:
    """Rows are only ever added, so two states of a session differ from some row on."""
    changed = _match_attributes(session, wanted)
    rows = array_at(wanted, "attempts/number").chunks[0]
    if array_at(session, "attempts/number").chunks[0] != rows:
        # A sealed session has its columns packed, and one that is open again must not.
        rechunk_columns(session, rows)
        changed = True
    size, wanted_size = (array_at(one, "attempts/number").shape[0] for one in (session, wanted))
    first = min(
        _first_difference(_rows(array_at(session, path)), _rows(array_at(wanted, path))) for path in column_paths()
    )
    if first == size == wanted_size:
        return changed
    for path in column_paths():
        # Whole chunks: what is left of the last one must not show again when the session grows.
        array = array_at(session, path)
        _copy_rows(array, array_at(wanted, path), chunk_start(first, array.chunks[0]))
    for path in frame_paths():
        _copy_rows(array_at(session, path), array_at(wanted, path), first)
    return True


def _first_difference(left: NDArray[Any], right: NDArray[Any]) -> int:
    """Number of the first row whose bits differ, or that only one of the two has."""
    shorter = min(len(left), len(right))
    if not shorter:
        return 0
    bits = [rows[:shorter].reshape(shorter, -1).view(np.uint8) for rows in (left, right)]
    differing = np.flatnonzero((bits[0] != bits[1]).any(axis=1))
    return int(differing[0]) if len(differing) else shorter


def _copy_rows(array: zarr.Array[Any], wanted: zarr.Array[Any], first: int) -> None:
    array.resize(wanted.shape)
    step = max(BATCH_FRAMES, wanted.chunks[0])
    for start in range(first, wanted.shape[0], step):
        stop = min(start + step, wanted.shape[0])
        array[start:stop] = read_rows(wanted, start, stop)


def _rows(array: zarr.Array[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(read_all(array))
