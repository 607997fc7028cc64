"""Disk space: forgetting old history, and deleting what no version needs any more.

Neither touches what a branch or release holds. Both keep away from what is being written: an open session that
committed lately may have pictures on disk that no version names yet.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.icechunk_engine import icechunk_errors, sync_file_system
from handsight.datasets.store.repository import GraspRepository

GRACE = timedelta(hours=1)
"""Files younger than this may belong to a commit in progress and are never deleted."""

ACTIVE_WINDOW = timedelta(days=1)
"""An open session that committed within this time may have a writer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GarbageReport:
    """What a collection deleted, or would delete."""

    dry_run: bool
    older_than: datetime
    """UTC. Only files older than this were looked at; earlier than asked for where something is being written."""
    retained_by: tuple[str, ...]
    """Open sessions that moved the time back."""
    bytes: int
    chunks: int
    snapshots: int
    other_files: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpiryReport:
    """Which commits left the history, or would."""

    dry_run: bool
    older_than: datetime
    snapshots: tuple[str, ...]
    """Their ids, newest first; no branch or release can be reverted to them any more."""


def collect_garbage(
    repository: GraspRepository, older_than: datetime | None = None, *, dry_run: bool, grace: timedelta = GRACE
) -> GarbageReport:
    """Delete files that no version needs: those of killed writers, deleted branches and expired commits.

    Args:
        repository: The dataset.
        older_than: Keep files younger than this; without it, only the grace keeps files.
        dry_run: Report and delete nothing.
        grace: Age up to which a file may belong to a commit in progress.

    Raises:
        StorageError: The disk is not writable.
        DatasetBusyError: Another process held the commit lock for too long.
    """
    with repository.locked():
        active = _active_sessions(repository)
        limits = [datetime.now(UTC) - grace, *active.values()]
        cutoff = min([*limits, older_than] if older_than is not None else limits)
        with icechunk_errors(f"cannot collect the garbage of {repository.path}"):
            found = repository.icechunk_repository.garbage_collect(cutoff, dry_run=dry_run)
        if not dry_run:
            sync_file_system(repository.path)
    return GarbageReport(
        dry_run=dry_run,
        older_than=cutoff,
        retained_by=tuple(session for session, when in active.items() if when <= cutoff),
        bytes=found.bytes_deleted,
        chunks=found.chunks_deleted,
        snapshots=found.snapshots_deleted,
        other_files=found.manifests_deleted + found.attributes_deleted + found.transaction_logs_deleted,
    )


def expire(repository: GraspRepository, older_than: datetime, *, dry_run: bool) -> ExpiryReport:
    """Drop commits from the history; their files go with the next :func:`collect_garbage`.

    Tips of branches and releases stay whatever their age.

    Raises:
        StorageError: The disk is not writable.
        DatasetBusyError: Another process held the commit lock for too long.
    """
    with repository.locked():
        named = {*repository.branches().values(), *(one.snapshot_id for one in repository.releases().values())}
        old: dict[str, None] = {}
        for entries in repository.logs(sorted(named)):
            for entry in entries:
                if entry.snapshot_id not in named and entry.written_at < older_than:
                    old.setdefault(entry.snapshot_id)
        if not dry_run:
            with icechunk_errors(f"cannot expire commits of {repository.path}"):
                repository.icechunk_repository.expire_snapshots(older_than)
            sync_file_system(repository.path)
    return ExpiryReport(dry_run=dry_run, older_than=older_than, snapshots=tuple(old))


def _active_sessions(repository: GraspRepository) -> dict[str, datetime]:
    """Time of the last commit of every open session that may have a writer, on any branch."""
    recent = datetime.now(UTC) - ACTIVE_WINDOW
    active: dict[str, datetime] = {}
    tips = list(repository.branches().values())
    for tip, entries in zip(tips, repository.logs(tips), strict=True):
        open_sessions = {one.ulid for one in GraspDataset(repository, ref=tip).sessions if one.status == "open"}
        for entry in entries:
            if entry.session in open_sessions and entry.written_at > recent:
                active[entry.session] = max(entry.written_at, active.get(entry.session, entry.written_at))
    return dict(sorted(active.items()))
