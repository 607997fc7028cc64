"""Disk space: forgetting old history, and deleting what no version needs any more.

Neither touches what a branch or release holds. Both keep away from what is being written: every writer is registered
while it is at work (store/writers.py), so that neither has to guess from how old something is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from handsight.datasets.address import S3Prefix
from handsight.datasets.errors import UnknownNameError
from handsight.datasets.store.agreement import refuse_lost_refs
from handsight.datasets.store.icechunk_engine import icechunk_errors, sync_file_system
from handsight.datasets.store.leftovers import clear_surroundings
from handsight.datasets.store.repository import GraspRepository, LogEntry
from handsight.datasets.store.writers import Writer, forget_dead_writers, writers_at_work

GRACE = timedelta(hours=1)
"""Younger files are never deleted: an older handsight, which does not register, may be about to commit them."""

_ALWAYS = datetime(1970, 1, 1, tzinfo=UTC)
_NEVER = datetime.max.replace(tzinfo=UTC)


@dataclass(frozen=True, slots=True, kw_only=True)
class GarbageReport:
    """What a collection deleted, or would delete."""

    dry_run: bool
    older_than: datetime
    """UTC. Only files older than this were looked at; earlier than asked for where something is being written."""
    retained_by: tuple[str, ...]
    """Sessions being recorded, and ids of other writers at work, that moved the time back."""
    writers: tuple[Writer, ...]
    """Everybody at work."""
    bytes: int
    chunks: int
    snapshots: int
    other_files: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpiryReport:
    """Which commits left the history, or would."""

    dry_run: bool
    older_than: datetime
    """UTC. Only commits older than this were dropped; earlier than asked for where something is being written."""
    snapshots: tuple[str, ...]
    """Their ids, newest first; no branch or release can be reverted to them any more."""
    retained_by: tuple[str, ...]
    """Sessions being recorded, and ids of other writers at work, that moved the time back."""
    writers: tuple[Writer, ...]
    """Everybody at work."""


def collect_garbage(
    repository: GraspRepository,
    older_than: datetime | None = None,
    *,
    dry_run: bool,
    grace: timedelta = GRACE,
    ignored_writers: Sequence[str] = (),
) -> GarbageReport:
    """Delete files that no version needs: those of killed writers, deleted branches and expired commits.

    What killed processes left in the dataset and beside it goes as well.

    Args:
        repository: The dataset.
        older_than: Keep files younger than this; without it, only the grace and writers at work keep files.
        dry_run: Report and delete nothing.
        grace: Age up to which a file may belong to a commit of somebody who does not register.
        ignored_writers: Ids of writers to a bucket that are registered from other machines, and known to be gone.

    Raises:
        CorruptDataError: A release or a branch is lost (agreement.py).
        UnknownNameError: No writer to be ignored has one of the ids.
        StorageError: The disk is not writable.
        DatasetBusyError: Another process held the commit lock for too long.
    """
    with repository.locked():
        refuse_lost_refs(repository, "collecting garbage")
        writers = _at_work(repository, ignored_writers, dry_run=dry_run)
        committed = _last_commits(repository, writers)
        kept_from = {
            one.id: max(one.begun, committed.get(one.session or "", one.begun)) for one in writers if one.reads is None
        }
        kept_from |= dict.fromkeys(_readers_of_the_nameless(repository, writers), _ALWAYS)
        limits = [datetime.now(UTC) - grace, *kept_from.values()]
        cutoff = min([*limits, older_than] if older_than is not None else limits)
        with icechunk_errors(f"cannot collect the garbage of {repository.path}"):
            found = repository.icechunk_repository.garbage_collect(cutoff, dry_run=dry_run)
        if not dry_run:
            if isinstance(repository.path, Path):
                clear_surroundings(repository.path, repository.side_folder)
            sync_file_system(repository.path)
    return GarbageReport(
        dry_run=dry_run,
        older_than=cutoff,
        retained_by=_names(one for one in writers if kept_from.get(one.id, _NEVER) <= cutoff),
        writers=writers,
        bytes=found.bytes_deleted,
        chunks=found.chunks_deleted,
        snapshots=found.snapshots_deleted,
        other_files=found.manifests_deleted + found.attributes_deleted + found.transaction_logs_deleted,
    )


def expire(
    repository: GraspRepository, older_than: datetime, *, dry_run: bool, ignored_writers: Sequence[str] = ()
) -> ExpiryReport:
    """Drop commits from the history; their files go with the next :func:`collect_garbage`.

    Tips of branches and releases stay whatever their age, and so does the version that a writer at work began from:
    its next commit is compared with it.

    Args:
        repository: The dataset.
        older_than: Keep commits younger than this.
        dry_run: Report and drop nothing.
        ignored_writers: As for :func:`collect_garbage`.

    Raises:
        UnknownNameError: No writer to be ignored has one of the ids.
        StorageError: The disk is not writable.
        DatasetBusyError: Another process held the commit lock for too long.
    """
    with repository.locked():
        refuse_lost_refs(repository, "expiring commits")
        writers = _at_work(repository, ignored_writers, dry_run=dry_run)
        branches = set(repository.branches().values())
        named = {*branches, *(one.snapshot_id for one in repository.releases().values())}
        histories = dict(zip(sorted(named), repository.logs(sorted(named)), strict=True))
        needed_from = {one.id: _needed_from(one, histories, branches) for one in writers}
        cutoff = min([older_than, *needed_from.values()])
        kept = {*named, *(one.reads for one in writers)}
        old: dict[str, None] = {}
        for entries in histories.values():
            for entry in entries:
                if entry.snapshot_id not in kept and entry.written_at < cutoff:
                    old.setdefault(entry.snapshot_id)
        if not dry_run:
            with icechunk_errors(f"cannot expire commits of {repository.path}"):
                repository.icechunk_repository.expire_snapshots(cutoff)
            sync_file_system(repository.path)
    return ExpiryReport(
        dry_run=dry_run,
        older_than=cutoff,
        snapshots=tuple(old),
        retained_by=_names(one for one in writers if needed_from[one.id] < older_than),
        writers=writers,
    )


def _at_work(repository: GraspRepository, ignored: Sequence[str], *, dry_run: bool) -> tuple[Writer, ...]:
    """Everybody at work but those to be ignored, after the entries of the others have been taken back."""
    writers = writers_at_work(repository)
    ids = [one.id for one in writers] if isinstance(repository.path, S3Prefix) else []
    unknown = [one for one in ignored if one not in ids]
    if unknown:
        raise UnknownNameError(
            f"{repository.path} has no writer {', '.join(unknown)} that can be ignored (writers: "
            f"{', '.join(ids) or 'none'}); only those to a bucket have to be, a local one ends with its process"
        )
    if not dry_run:
        forget_dead_writers(repository, frozenset(ignored))
    return tuple(one for one in writers if one.id not in ignored)


def _last_commits(repository: GraspRepository, writers: Sequence[Writer]) -> dict[str, datetime]:
    """Time of the last commit, on any branch, of every session that is being recorded: until then all has a name."""
    sessions = {one.session for one in writers} - {None}
    last: dict[str, datetime] = {}
    if sessions:
        for entries in repository.logs(repository.branches().values()):
            for entry in entries:
                if entry.session is not None and entry.session in sessions:
                    last[entry.session] = max(entry.written_at, last.get(entry.session, entry.written_at))
    return last


def _readers_of_the_nameless(repository: GraspRepository, writers: Sequence[Writer]) -> list[str]:
    """Ids of readers of versions that no name leads to: any file may be one that they need, whatever its age."""
    readers = [one for one in writers if one.reads is not None]
    if not readers or isinstance(repository.path, S3Prefix):
        return []  # In a bucket the reader's branch leads to the version.
    tips = [*repository.branches().values(), *(one.snapshot_id for one in repository.releases().values())]
    reachable = {entry.snapshot_id for entries in repository.logs(dict.fromkeys(tips)) for entry in entries}
    return [one.id for one in readers if one.reads not in reachable]


def _needed_from(one: Writer, histories: Mapping[str, Sequence[LogEntry]], branches: Iterable[str]) -> datetime:
    """When the oldest version was written that somebody at work needs to stay in the history."""
    if one.reads is None:
        return min(_found_by(one, histories[tip]) for tip in branches)
    read = (entry.written_at for entries in histories.values() for entry in entries if entry.snapshot_id == one.reads)
    return next(read, _NEVER)


def _found_by(writer: Writer, history: Sequence[LogEntry]) -> datetime:
    """When the version was written that a writer found at the tip of a branch, if that is not the tip any more."""
    if not history or history[0].written_at <= writer.begun:
        return _NEVER
    return next((entry.written_at for entry in history if entry.written_at <= writer.begun), history[-1].written_at)


def _names(writers: Iterable[Writer]) -> tuple[str, ...]:
    return tuple(sorted({one.session or one.id for one in writers}))
