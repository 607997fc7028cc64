"""A dataset with its history: branches, releases, commits."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import icechunk
import zarr
from filelock import FileLock, Timeout

from handsight.datasets.address import (
    DEFAULT_REF,
    SIDE_FOLDER,
    Location,
    S3Prefix,
    cache_folder,
    location_of,
    no_dataset_at,
)
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
    StorageError,
    headline,
    pasteable,
)
from handsight.datasets.machine import cause_and_remedy, of_the_machine
from handsight.datasets.store.icechunk_engine import (
    icechunk_errors,
    lookup_branches,
    open_store,
    publish,
    publish_shared,
    sync_file_system,
)
from handsight.datasets.store.layout import check_schema, refuse_occupied, write_empty
from handsight.datasets.store.leftovers import clear_leftovers
from handsight.datasets.store.lookup import branch_of, version_named, version_names
from handsight.datasets.store.refs import create_ref, is_deleted_tag, main_is_lost
from handsight.datasets.store.releases import (
    LEDGER_BRANCH,
    Release,
    add_to_ledger,
    check_ref_name,
    confirmed_releases,
    read_ledger,
)
from handsight.datasets.store.snapshot_ids import is_beginning, snapshots_beginning
from handsight.datasets.writable import dataset_fault, refuse_unwritable

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
            StorageError: No folder can be made there.
        """
        path = location_of(path)
        refuse_occupied(path)
        if isinstance(path, S3Prefix):
            with icechunk_errors(f"cannot create a dataset at {path}"):
                write_empty(path)
            return cls.open(path)
        refuse_unwritable(path)
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
    def open(cls, path: str | Location, *, check: bool = True) -> GraspRepository:
        """Open an existing dataset.

        Args:
            path: Where it is.
            check: Look whether the branch ``main`` is of a dataset that this handsight can read. Whoever looks at
                another version at once has no need for it, and each look takes a bucket several requests.

        Raises:
            DatasetNotFoundError: Nothing is there.
            NotADatasetError: The path is a file or a folder that is no dataset.
            SchemaError: The dataset was written by a newer handsight.
            CorruptDataError: Icechunk cannot begin with it: its configuration or a branch's name is damaged; or the
                main branch of a local dataset is lost (restoring.py).
            StorageError: The machine cannot read.
        """
        path = location_of(path)
        if isinstance(path, Path) and main_is_lost(path):
            raise CorruptDataError(
                f"the main branch of {path} is gone, damaged, or leads nowhere: "
                f"{pasteable('handsight', 'dataset', 'repair', path, '--branch', 'mended')} gives it its newest commit "
                "again"
            )
        opened = open_store(path)
        if opened is None:
            raise no_dataset_at(path)
        repository = cls(path, opened)
        if check:
            check_schema(path, repository._root_of_branch(DEFAULT_REF).attrs.asdict().get("schema_version"))
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

    @cached_property
    def side_folder(self) -> Path:
        """Local folder for caches of this dataset; it need not exist, and may be deleted at any time."""
        if isinstance(self.path, S3Prefix):
            uuid = str(self._root_of_branch(DEFAULT_REF).attrs["dataset_uuid"])
            return cache_folder() / "datasets" / uuid
        return self.path / SIDE_FOLDER

    def tip(self, branch: str) -> str:
        """The snapshot id of a branch.

        Raises:
            RefNotFoundError: There is no such branch.
        """
        self.check_process()
        with icechunk_errors(f"cannot look up branch {branch!r} of {self.path}"), branch_of(self.path, branch):
            return self._icechunk.lookup_branch(branch)

    @property
    def icechunk_repository(self) -> icechunk.Repository:
        """What Icechunk opened, for the modules of this room that look after branches and disk space."""
        self.check_process()
        return self._icechunk

    def branches(self) -> dict[str, str]:
        """Snapshot id of each branch by name, sorted."""
        self.check_process()
        _, names = version_names(self.path)
        return self._tips(names)

    def releases(self) -> dict[str, Release]:
        """Releases by name, sorted."""
        self.check_process()
        names, _ = version_names(self.path)
        return read_ledger(self.ledger(), self._released(names)) if names else {}

    def resolve(self, ref: str) -> str:
        """The snapshot id that a release, a branch, a snapshot id or its beginning names, looked up in this order.

        Raises:
            RefNotFoundError: None of them has that name, and the message lists those that are; or several ids begin so.
        """
        return self._version(ref).snapshot_id

    def version(self, ref: str) -> tuple[str, zarr.Group]:
        """As :meth:`resolve`, with the root group of the version, read-only.

        Raises:
            RefNotFoundError: There is no such ref.
            CorruptDataError: The root group is damaged.
        """
        session = self._version(ref)
        return session.snapshot_id, self._root_of(session)

    def is_taken(self, name: str) -> bool:
        """Whether a release or a branch has that name."""
        self.check_process()
        return version_named(self._icechunk, self.path, name) is not None

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
            known = confirmed_releases(self.ledger()).get(name)
            if known and name not in version_names(self.path)[0] and not is_deleted_tag(self.path, name):
                raise RefNameError(
                    f"{name!r} is a release of {self.path} that is lost: choose another name, or give it back by "
                    f"{pasteable('handsight', 'dataset', 'repair', self.path, '--branch', 'repaired')}"
                )
            release = Release(name=name, snapshot_id=self.resolve(ref), message=message, released_at=datetime.now(UTC))
            self.change_ledger(f"release {name}", lambda root: add_to_ledger(root, release, pending=True))
            create_ref(self._icechunk, self.path, "tag", name, release.snapshot_id)
            self.change_ledger(f"released {name}", lambda root: add_to_ledger(root, release, pending=False))
        return release

    def ledger(self) -> zarr.Group:
        """The root of the ledger, read-only (releases.py)."""
        return self._root_of_branch(LEDGER_BRANCH)

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
        releases, branches = version_names(self.path)
        for name, target in (*self._released(releases).items(), *self._tips(branches).items()):
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
            return self._root_of(self._icechunk.readonly_session(snapshot_id=snapshot_id))

    def writable(self, branch: str) -> icechunk.Session:
        """A transaction whose changes :meth:`commit` will put onto the branch; Icechunk calls it a session.

        Raises:
            RefNotFoundError: There is no such branch.
        """
        self.check_process()
        with icechunk_errors(f"cannot write to branch {branch!r} of {self.path}"), branch_of(self.path, branch):
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

        # A commit says which branch it was for, should that be lost (restoring.py) or change places with another.
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
            StorageError: The dataset cannot be written to.
        """
        self.check_process()
        if self._lock is None:
            yield
            return
        try:
            self.side_folder.mkdir(exist_ok=True)
            self._lock.acquire()
        except Timeout as error:
            raise DatasetBusyError(
                f"another process has held {self._lock.lock_file} for {_LOCK_TIMEOUT_S:.0f} s: "
                "find it and stop it, then try again"
            ) from error
        except OSError as error:
            fault = dataset_fault(self.folder) or f"{self.side_folder}: {error.strerror}"
            raise StorageError(f"cannot write to {self.path}: {fault}; mend that, or choose another place") from error
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

    def _version(self, ref: str) -> icechunk.Session:
        self.check_process()
        session = version_named(self._icechunk, self.path, ref)
        if session is not None:
            return session
        beginning = self._snapshots_beginning(ref)
        if len(beginning) > 1:
            raise RefNotFoundError(
                f"{ref!r} in {self.path} can be any of {len(beginning)} snapshots, such as "
                f"{', '.join(beginning[:2])}; write out more of the id"
            )
        if beginning:
            with icechunk_errors(f"cannot read snapshot {beginning[0]} of {self.path}"):
                return self._icechunk.readonly_session(snapshot_id=beginning[0])
        releases, branches = version_names(self.path)
        known = f"releases: {', '.join(releases) or 'none'}; branches: {', '.join(branches)}"
        raise RefNotFoundError(f"{self.path} has no release, branch or snapshot {ref!r} ({known})")

    def _snapshots_beginning(self, text: str) -> list[str]:
        if not is_beginning(text):
            return []  # Histories take a while to read.
        releases, branches = version_names(self.path)
        tips = (*self._released(releases).values(), *self._tips(branches).values())
        with icechunk_errors(f"cannot read the history of {self.path}"):
            return snapshots_beginning(self._icechunk, text, tips)

    def _root_of_branch(self, branch: str) -> zarr.Group:
        self.check_process()
        with icechunk_errors(f"cannot read branch {branch!r} of {self.path}"):
            with branch_of(self.path, branch):
                session = self._icechunk.readonly_session(branch)
            return self._root_of(session)

    def _root_of(self, session: icechunk.Session) -> zarr.Group:
        with icechunk_errors(f"cannot read snapshot {session.snapshot_id} of {self.path}"):
            try:
                return zarr.open_group(session.store, mode="r")
            except FileNotFoundError as error:
                if trouble := of_the_machine(f"the root of {self.path}@{session.snapshot_id} cannot be read", error):
                    raise trouble from error
                raise NotADatasetError(f"{self.path} holds no root group, expected a handsight dataset") from error
            except (TypeError, ValueError, RuntimeError, OSError) as error:
                if trouble := of_the_machine(f"the root of {self.path}@{session.snapshot_id} cannot be read", error):
                    raise trouble from error
                fault = f"the root of {self.path}@{session.snapshot_id} is damaged: {error}"
                raise CorruptDataError(fault) from error

    def _released(self, names: Sequence[str]) -> dict[str, str]:
        """The snapshot id of each of these releases.

        Those that the ledger knows are read from it, which is one file, and the others from theirs.
        """
        known: dict[str, str | None] = {}
        if names:
            with suppress(CorruptDataError, RefNotFoundError, StorageError):  # Then each tag has to say it.
                known = confirmed_releases(self.ledger())
        with icechunk_errors(f"cannot look up the releases of {self.path}"):
            return {name: known.get(name) or self._icechunk.lookup_tag(name) for name in names}

    def _tips(self, names: Sequence[str]) -> dict[str, str]:
        with icechunk_errors(f"cannot look up the branches of {self.path}"):
            return lookup_branches(self._icechunk, names)

    def has_snapshot(self, snapshot_id: str) -> bool:
        """Whether there is a snapshot of that id that can be read, whatever leads to it.

        Raises:
            StorageError: The machine cannot tell.
        """
        try:
            self._icechunk.lookup_snapshot(snapshot_id)
        except icechunk.IcechunkError as error:
            if trouble := of_the_machine(f"snapshot {snapshot_id} of {self.path} cannot be read", error):
                raise trouble from error
            return False
        return True

    def is_stored(self, snapshot_id: str) -> bool:
        """As :meth:`has_snapshot`, but asks the disk or bucket anew; what cannot be asked counts as there."""
        self.check_process()
        try:
            self._icechunk.readonly_session(snapshot_id=snapshot_id)
        except icechunk.IcechunkError as error:
            # Icechunk says so of a file that it could not open, too.
            return not headline(error).startswith("snapshot not found") or cause_and_remedy(error) is not None
        return True
