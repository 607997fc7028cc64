"""A dataset with its history: branches, releases, commits."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from shlex import quote
from typing import Any

import icechunk
import zarr
from filelock import FileLock, Timeout

from handsight.datasets.address import DEFAULT_REF, Location, S3Prefix, cache_folder, location_of, no_dataset_at
from handsight.datasets.atomic import atomic_folder
from handsight.datasets.errors import (
    CorruptDataError,
    DatasetBusyError,
    DatasetNotFoundError,
    ForkedProcessError,
    NotADatasetError,
    RefNameError,
    RefNotFoundError,
    SessionConflictError,
    headline,
)
from handsight.datasets.store.icechunk_engine import (
    icechunk_errors,
    publish,
    publish_shared,
    storage_at,
    sync_file_system,
)
from handsight.datasets.store.layout import check_schema, is_icechunk_folder, refuse_occupied, write_empty
from handsight.datasets.store.leftovers import clear_leftovers
from handsight.datasets.store.refs import create_ref, main_is_lost
from handsight.datasets.store.releases import (
    LEDGER_BRANCH,
    Release,
    add_to_ledger,
    check_ref_name,
    is_internal,
    is_snapshot_id,
    read_ledger,
)

SIDE_FOLDER = ".handsight"
"""Folder inside a local dataset for what is not part of any version: the lock and caches."""

_LOCK_TIMEOUT_S = 120.0
"""A commit holds the lock for milliseconds, so a longer wait means that something is stuck."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LogEntry:
    """One commit in the history of a version."""

    snapshot_id: str
    message: str
    written_at: datetime
    attempts_added: int
    session: str | None
    """The session that the commit recorded to; None for any other commit."""
    refs: tuple[str, ...]
    """Releases and branches that point to this snapshot."""


class GraspRepository:
    """A dataset in a folder or a bucket, open in this process.

    Use :meth:`create`, :meth:`open` or :meth:`open_or_create`. Any number of processes may have the same
    dataset open and commit to it; on a local disk, where Icechunk loses concurrent commits, they take a lock. A forked
    child must open the dataset itself, in a process started by spawn or forkserver: Icechunk hangs after a fork.
    """

    def __init__(self, path: Location, opened: icechunk.Repository) -> None:
        self.path = path
        self._icechunk = opened
        self._owner_pid = os.getpid()
        self._lock: FileLock | None = None
        self._tidy = False
        if not isinstance(path, S3Prefix):
            self._lock = FileLock(path / SIDE_FOLDER / "commit.lock", timeout=_LOCK_TIMEOUT_S, poll_interval=0.005)

    @classmethod
    def create(cls, path: str | Location) -> GraspRepository:
        """Create an empty dataset, and the folders above it.

        A folder appears at once or not at all: it is made under another name beside its own and renamed.

        Raises:
            DatasetExistsError: There is a dataset already.
            NotADatasetError: The path is a file or a folder with something else in it.
        """
        path = location_of(path)
        refuse_occupied(path)
        if isinstance(path, S3Prefix):
            with icechunk_errors(f"cannot create a dataset at {path}"):
                write_empty(path)
            return cls.open(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with atomic_folder(path) as unfinished, icechunk_errors(f"cannot create a dataset at {path}"):
                write_empty(unfinished)
        except OSError:
            refuse_occupied(path)  # Another process may have been first.
            raise
        sync_file_system(path)
        return cls.open(path)

    @classmethod
    def open(cls, path: str | Location) -> GraspRepository:
        """Open an existing dataset.

        Raises:
            DatasetNotFoundError: Nothing is there.
            NotADatasetError: The path is a file or a folder that is no dataset.
            SchemaError: The dataset was written by a newer handsight.
            CorruptDataError: The main branch of a local dataset is lost (restoring.py).
        """
        path = location_of(path)
        if isinstance(path, Path) and main_is_lost(path):
            raise CorruptDataError(
                f"the main branch of {path} is gone, damaged, or leads nowhere: 'handsight dataset repair "
                f"{quote(str(path))} --branch mended' gives it its newest commit again"
            )
        if not is_icechunk_folder(path):
            raise no_dataset_at(path)
        with icechunk_errors(f"cannot open {path}"):
            repository = cls(path, icechunk.Repository.open(storage_at(path)))
            attributes = repository.root(repository.resolve(DEFAULT_REF)).attrs.asdict()
        check_schema(path, attributes.get("schema_version"))
        return repository

    @classmethod
    def open_or_create(cls, path: str | Location) -> GraspRepository:
        """Open the dataset, or create it where nothing is there."""
        try:
            return cls.open(path)
        except DatasetNotFoundError:
            return cls.create(path)

    @property
    def folder(self) -> Path:
        """The folder of a local dataset.

        Raises:
            NotADatasetError: The dataset is in a bucket.
        """
        if isinstance(self.path, S3Prefix):
            raise NotADatasetError(
                f"{self.path} is in a bucket, expected a local folder: merge it into a local dataset"
            )
        return self.path

    @property
    def side_folder(self) -> Path:
        """Local folder for caches of this dataset; it need not exist, and may be deleted at any time."""
        if isinstance(self.path, S3Prefix):
            uuid = str(self.root(self.resolve(DEFAULT_REF)).attrs["dataset_uuid"])
            return cache_folder() / "datasets" / uuid
        return self.path / SIDE_FOLDER

    def tip(self, branch: str) -> str:
        """The snapshot id of a branch.

        Raises:
            RefNotFoundError: There is no such branch.
        """
        self._check_branch(branch)
        with icechunk_errors(f"cannot look up branch {branch!r} of {self.path}"):
            return self._icechunk.lookup_branch(branch)

    @property
    def icechunk_repository(self) -> icechunk.Repository:
        """What Icechunk opened, for the modules of this room that look after branches and disk space."""
        self.check_process()
        return self._icechunk

    def branches(self) -> dict[str, str]:
        """Snapshot id of each branch by name, sorted."""
        self.check_process()
        with icechunk_errors(f"cannot list the branches of {self.path}"):
            names = self._branch_names()
            return {name: self._icechunk.lookup_branch(name) for name in names}

    def releases(self) -> dict[str, Release]:
        """Releases by name, sorted."""
        tags = self._tags()
        return read_ledger(self.ledger(), tags) if tags else {}

    def resolve(self, ref: str) -> str:
        """The snapshot id that a release, a branch or a snapshot id names, looked up in this order.

        Raises:
            RefNotFoundError: None of them has that name; the message lists those that exist.
        """
        self.check_process()
        with icechunk_errors(f"cannot look up {ref!r} in {self.path}"):
            snapshot_id = _looked_up(self._icechunk.lookup_tag, self._icechunk.list_tags, ref)
            if snapshot_id is None and not is_internal(ref):
                snapshot_id = _looked_up(self._icechunk.lookup_branch, self._icechunk.list_branches, ref)
        if snapshot_id is not None:
            return snapshot_id
        if is_snapshot_id(ref) and self.has_snapshot(ref):
            return ref
        releases, branches = self._names()
        known = f"releases: {', '.join(releases) or 'none'}; branches: {', '.join(branches)}"
        raise RefNotFoundError(f"{self.path} has no release, branch or snapshot {ref!r} ({known})")

    def is_taken(self, name: str) -> bool:
        """Whether a release or a branch has that name."""
        return any(name in names for names in self._names())

    def release(self, name: str, ref: str = DEFAULT_REF, message: str = "") -> Release:
        """Give a snapshot a name for good. A release can be neither moved nor made again under its name.

        Raises:
            RefNameError: The name is malformed, taken by a release or branch, or belonged to a deleted release.
            RefNotFoundError: There is no such ref.
        """
        check_ref_name("release", name)
        with self.locked():
            if self.is_taken(name):
                raise RefNameError(f"{name!r} is taken in {self.path}: releases are immutable, choose another name")
            release = Release(name=name, snapshot_id=self.resolve(ref), message=message, released_at=datetime.now(UTC))
            self.change_ledger(f"release {name}", lambda root: add_to_ledger(root, release, pending=True))
            create_ref(self._icechunk, self.path, "tag", name, release.snapshot_id)
            self.change_ledger(f"released {name}", lambda root: add_to_ledger(root, release, pending=False))
        return release

    def ledger(self) -> zarr.Group:
        """The root of the ledger, read-only (releases.py)."""
        return self.root(self.tip(LEDGER_BRANCH))

    def change_ledger(self, message: str, change: Callable[[zarr.Group], None]) -> None:
        """Commit a change to the ledger, after others that reach a bucket at the same time."""
        while True:
            transaction = self.writable(LEDGER_BRANCH)
            change(zarr.open_group(transaction.store, mode="r+"))
            try:
                self.commit(transaction, branch=LEDGER_BRANCH, message=message)
            except SessionConflictError:
                continue  # Lost the race to another release: retry behind it.
            return

    def log(self, ref: str = DEFAULT_REF) -> list[LogEntry]:
        """The commits that led to a version, newest first.

        Raises:
            RefNotFoundError: There is no such ref.
        """
        (entries,) = self.logs([self.resolve(ref)])
        return entries

    def logs(self, snapshot_ids: Iterable[str]) -> Iterator[list[LogEntry]]:
        """As :meth:`log` for some snapshots, one after another; releases and branches are looked up once for all."""
        refs: dict[str, list[str]] = {}
        for name, target in (*self._tags().items(), *self.branches().items()):
            refs.setdefault(target, []).append(name)
        for snapshot_id in snapshot_ids:
            with icechunk_errors(f"cannot read the history of {self.path}"):
                entries = [
                    LogEntry(
                        snapshot_id=commit.id,
                        message=commit.message,
                        written_at=commit.written_at,
                        attempts_added=int(commit.metadata.get("attempts_added", 0)),
                        session=commit.metadata.get("session"),
                        refs=tuple(refs.get(commit.id, ())),
                    )
                    for commit in self._icechunk.ancestry(snapshot_id=snapshot_id)
                    if commit.parent_id is not None  # Icechunk's own empty first snapshot.
                ]
            yield entries

    def root(self, snapshot_id: str) -> zarr.Group:
        """The root group of a snapshot, read-only."""
        self.check_process()
        with icechunk_errors(f"cannot read snapshot {snapshot_id} of {self.path}"):
            transaction = self._icechunk.readonly_session(snapshot_id=snapshot_id)
            try:
                return zarr.open_group(transaction.store, mode="r")
            except FileNotFoundError as error:
                raise NotADatasetError(f"{self.path} holds no root group, expected a handsight dataset") from error
            except (TypeError, ValueError) as error:
                raise CorruptDataError(f"the root of {self.path}@{snapshot_id} is damaged: {error}") from error

    def writable(self, branch: str) -> icechunk.Session:
        """A transaction whose changes :meth:`commit` will put onto the branch; Icechunk calls it a session.

        Raises:
            RefNotFoundError: There is no such branch.
        """
        self._check_branch(branch)
        with icechunk_errors(f"cannot write to branch {branch!r} of {self.path}"):
            return self._icechunk.writable_session(branch)

    def commit(
        self,
        transaction: icechunk.Session,
        *,
        branch: str,
        message: str,
        metadata: Mapping[str, Any] | None = None,
        check: Callable[[zarr.Group], None] | None = None,
    ) -> str:
        """Put a transaction's changes onto its branch, after whatever others have committed since, and return the id.

        A transaction without changes adds no commit; the tip of the branch is returned.
        ``check`` sees the branch as it is just before, with no commit of anybody else in between, and may refuse by
        raising.

        Raises:
            SessionConflictError: Somebody else has committed changes to the same arrays.
            DatasetBusyError: Another process held the lock for too long.
        """

        def check_tip(tip: str) -> None:
            if check is not None:
                check(self.root(tip))

        # A commit says which branch it was for, should that be lost (restoring.py).
        what: dict[str, Any] = {
            "branch": branch,
            "message": message,
            "metadata": {**(metadata or {}), "branch": branch},
        }
        with self.locked(), icechunk_errors(f"cannot commit to {self.path}"):
            if not transaction.has_uncommitted_changes:
                return self._icechunk.lookup_branch(branch)
            try:
                if isinstance(self.path, S3Prefix):
                    return publish_shared(self._icechunk, transaction, check=check_tip, **what)
                check_tip(self._icechunk.lookup_branch(branch))
                return publish(self._icechunk, transaction, root=self.path, **what)
            except (icechunk.RebaseFailedError, icechunk.ConflictError) as error:
                raise SessionConflictError(
                    f"another process has changed the same session of {self.path} on branch {branch!r}: "
                    "stop one of the two, then go on with --resume"
                ) from error

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep every other process of this machine from committing; in a bucket it keeps out nobody.

        Raises:
            DatasetBusyError: Another process held the lock for too long.
        """
        self.check_process()
        if self._lock is None:
            yield
            return
        self.side_folder.mkdir(exist_ok=True)
        try:
            self._lock.acquire()
        except Timeout as error:
            raise DatasetBusyError(
                f"another process has held {self._lock.lock_file} for {_LOCK_TIMEOUT_S:.0f} s: "
                "find it and stop it, then try again"
            ) from error
        try:
            if not self._tidy:
                clear_leftovers(self.folder, self.side_folder)
                self._tidy = True
            yield
        finally:
            self._lock.release()

    def check_process(self) -> None:
        """Refuse to go on in a forked child, where Icechunk would hang.

        Raises:
            ForkedProcessError: This process did not open the repository.
        """
        if os.getpid() != self._owner_pid:
            raise ForkedProcessError(
                f"{self.path} was opened in process {self._owner_pid} and is used in process {os.getpid()}: start "
                "workers with the 'spawn' or 'forkserver' method and open the dataset in each of them"
            )

    def _check_branch(self, branch: str) -> None:
        self.check_process()
        if branch not in self._icechunk.list_branches():
            raise RefNotFoundError(f"{self.path} has no branch {branch!r} (branches: {', '.join(self._names()[1])})")

    def _names(self) -> tuple[list[str], list[str]]:
        """Names of the releases and of the branches, each sorted."""
        self.check_process()
        with icechunk_errors(f"cannot list the releases and branches of {self.path}"):
            return sorted(self._icechunk.list_tags()), self._branch_names()

    def _branch_names(self) -> list[str]:
        return sorted(name for name in self._icechunk.list_branches() if not is_internal(name))

    def _tags(self) -> dict[str, str]:
        self.check_process()
        with icechunk_errors(f"cannot list the releases of {self.path}"):
            return {name: self._icechunk.lookup_tag(name) for name in sorted(self._icechunk.list_tags())}

    def has_snapshot(self, snapshot_id: str) -> bool:
        """Whether there is a snapshot of that id, whatever leads to it."""
        try:
            self._icechunk.lookup_snapshot(snapshot_id)
        except icechunk.IcechunkError:
            return False
        return True


def _looked_up(lookup: Callable[[str], str], names: Callable[[], set[str]], name: str) -> str | None:
    """The snapshot id behind a tag or a branch; None where there is none of that name.

    Icechunk has one error for whatever goes wrong: unless that says plainly that there is no such ref, the names, of
    which the store is asked only then, decide whether it is passed on.
    """
    try:
        return lookup(name)
    except icechunk.IcechunkError as error:
        if headline(error).startswith("ref not found") or name not in names():
            return None
        raise
