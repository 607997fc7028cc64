"""Proof that stored bytes are those that were recorded.

Every chunk carries a crc32c, so most damage shows when it is decoded. What is decoded is then hashed again and
compared with the digest recorded with the attempt, which also finds pictures that were swapped, rows that were moved
and anything that was changed with its checksum. Ids and clocks, which the digest leaves out, are covered by the
checksum alone. A chunk that the engine has lost has none and reads as the fill value: where no digest would tell,
chunks are counted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass

import numpy as np
import zarr

from handsight.datasets.address import Location
from handsight.datasets.curation.folds import FOLDS
from handsight.datasets.errors import CorruptDataError, StorageError
from handsight.datasets.format.arrays import READ_FAILURES, array_at, damage_or_trouble, group_at, read_all
from handsight.datasets.format.decisions import CURATION, read_overlay
from handsight.datasets.format.saved_filters import FILTERS_GROUP
from handsight.datasets.format.schema import COLUMNS, SESSIONS, ColumnWidths
from handsight.datasets.format.scores import SCORES, read_scores, score_names
from handsight.datasets.format.sessions import attribute_damage
from handsight.datasets.integrity.attempt_checks import AttemptChecker, AttemptRange, Checked
from handsight.datasets.machine import machine_blamed
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.agreement import lost_refs
from handsight.datasets.store.readers import being_read, refuse_removed
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.store.version_files import VersionFiles
from handsight.jobs.processes import process_pool

_IN_NO_DIGEST = {column.name for column in COLUMNS if not column.digested} - {"number", "catalogue_index", "digest"}
"""A number is compared with the row's place, names of objects are in the digest, and that is compared as it is."""
_RANGE = 64
"""Attempts checked at a time, about 0.6 s of work; it divides the chunks of columns."""

_WORTH_A_PROCESS = 512
"""Attempts that take longer to check than a process takes to start."""


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
    """Damage to what belongs to no single attempt: session headers, curation, folds, filters, scores."""
    lost_refs: tuple[str, ...]
    """Releases and branches that are not what the ledger says, and what to do."""

    @property
    def corrupt(self) -> tuple[str, ...]:
        """Ids of the corrupt attempts, in the order of the table."""
        return tuple(self.faults)

    @property
    def ok(self) -> bool:
        """Whether every byte is as it was recorded."""
        return not self.faults and not self.damage and not self.lost_refs


def verify(dataset: GraspDataset, *, jobs: int = 1, on_checked: Callable[[int], None] | None = None) -> VerifyReport:
    """Read every byte of a version and name the attempts whose bytes are not those recorded.

    Args:
        dataset: The version to check.
        jobs: Processes at most; one for every few hundred attempts. With more than one, a script has to keep what it
            does under ``if __name__ == "__main__"``, because its processes are spawned.
        on_checked: Called with the number of attempts checked so far.

    Raises:
        CorruptDataError: The list of sessions itself cannot be read.
        VersionRemovedError: The version was expired and collected meanwhile.
        StorageError: The machine cannot read, so that what is damaged is not known; or a process ended before its time.
        ForkedProcessError: The dataset was opened in another process.
    """
    with being_read(dataset.repository, dataset.snapshot_id, "verify"):
        report = _verified(dataset, jobs, on_checked)
        if not report.ok:
            refuse_removed(dataset.repository, dataset.snapshot_id)
    return report


def _verified(dataset: GraspDataset, jobs: int, on_checked: Callable[[int], None] | None) -> VerifyReport:
    sessions = [session.ulid for session in dataset.sessions]
    total = check_sessions(dataset, sessions, jobs=jobs, on_checked=on_checked)
    return VerifyReport(
        checked=total.attempts,
        bytes=total.bytes,
        faults=total.faults,
        damage=(*damage_beside(dataset.root), *_lost_chunks(dataset)),
        lost_refs=tuple(one.fault for one in lost_refs(dataset.repository)),
    )


def check_sessions(
    dataset: GraspDataset, sessions: Collection[str], *, jobs: int, on_checked: Callable[[int], None] | None = None
) -> Checked:
    """Read every byte of the attempts of some sessions; arguments and errors as for :func:`verify`."""
    whole = [AttemptRange(one.ulid, 0, one.attempts) for one in dataset.sessions if one.ulid in sessions]
    ranges = [piece for session in whole for piece in session.cut(_RANGE)]
    attempts = sum(session.stop for session in whole)
    workers = min(jobs, max(1, attempts // _WORTH_A_PROCESS))
    found = map(AttemptChecker(dataset).check, ranges) if workers == 1 else _spread(dataset, ranges, workers)
    parts: list[Checked] = []
    checked = 0
    for part in found:
        parts.append(part)
        checked += part.attempts
        if on_checked is not None:
            on_checked(checked)
    return Checked.merged(parts)


def _spread(dataset: GraspDataset, ranges: Sequence[AttemptRange], workers: int) -> Iterator[Checked]:
    """What processes find, in the order of the ranges. Threads would share one interpreter and wait for it."""
    pool = process_pool(workers, _open_checker, dataset.repository.path, dataset.snapshot_id)
    try:
        with machine_blamed("no process can be started to verify attempts"):
            yield from pool.map(_check, ranges)
    except BrokenExecutor as error:
        raise StorageError(
            "a process that verified attempts ended before its time, perhaps for lack of memory: use fewer with --jobs"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


_checkers: list[AttemptChecker] = []
"""The one of this process, where it is one of those that verify."""


def _open_checker(path: Location, snapshot_id: str) -> None:
    _checkers.append(AttemptChecker(GraspDataset(GraspRepository.open(path), ref=snapshot_id)))


def _check(attempts: AttemptRange) -> Checked:
    (checker,) = _checkers
    return checker.check(attempts)


def damage_beside(root: zarr.Group) -> Iterator[str]:
    """What is damaged beside the attempts, all of it read: sessions' descriptions, curation, filters, folds, scores.

    Raises:
        StorageError: The machine cannot read.
    """
    try:
        for ulid, session in sorted(group_at(root, SESSIONS).groups()):
            yield from (f"session {ulid}: {fault}" for fault in _session_faults(session))
        for name in sorted(set(root.group_keys()) - {SESSIONS}):
            if name not in (CURATION, FOLDS, FILTERS_GROUP, SCORES):
                yield f"there is a group {name!r}, which handsight does not make"
            for _, node in sorted(group_at(root, name).members(max_depth=None)):
                if isinstance(node, zarr.Array):
                    read_all(node)
        read_overlay(root)
        for name in score_names(root):
            read_scores(root, name)
    except READ_FAILURES as error:
        if isinstance(error, StorageError):
            raise
        found = damage_or_trouble(error, trouble="what lies beside the attempts cannot be read", damage=str(error))
        if isinstance(found, StorageError):
            raise found from error
        yield str(found)


def _lost_chunks(dataset: GraspDataset) -> Iterator[str]:
    """Manifests that name too few chunks of what no digest covers.

    Raises:
        StorageError: The machine cannot read.
    """
    try:
        yield from map(str, VersionFiles(dataset.repository, dataset.snapshot_id).damage(_no_digest_covers))
    except CorruptDataError as error:
        yield str(error)


def _no_digest_covers(path: str) -> bool:
    """Whether an array lies beside the attempts, or holds of them what nothing else is compared with: their clocks."""
    return not path.startswith(f"/{SESSIONS}/") or path.rpartition("/attempts/")[2] in _IN_NO_DIGEST


def _session_faults(group: zarr.Group) -> list[str]:
    """Attributes that changed, and columns that are not laid out as the schema says: their bytes would be misread."""
    faults = attribute_damage(group.attrs.asdict())
    widths = ColumnWidths(*(array_at(group, f"attempts/{name}").shape[1] for name in ("catalogue_index", "conditions")))
    for column in COLUMNS:
        array = array_at(group, f"attempts/{column.name}")
        found = (array.dtype, array.shape[1:], np.array(array.fill_value, array.dtype).tobytes())
        dtype = np.dtype(column.dtype)
        if found != (dtype, column.shape(widths), np.array(column.fill, dtype).tobytes()):
            faults.append(
                f"column {column.name} has type {array.dtype}, rows of {array.shape[1:]}, fill value "
                f"{array.fill_value}; expected {dtype}, {column.shape(widths)}, {column.fill}"
            )
    return faults
