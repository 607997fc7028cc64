"""Who is writing to a dataset, for those who delete what no version needs.

Chunks are stored before the commit that names them, of an import hours before, so every writer registers before its
first one and tells until its last commit that it is at work. A registration is a file that its process holds locked
(held.py), in the side folder: a stopped writer counts, a killed one does not, and nobody has to guess from ages.

No lock reaches from machine to machine over a bucket, so there a branch stands for the writer as well. It begins at the
version that the writer found, and says when and where the writer began. Only the writer's own machine can tell that it
is gone; elsewhere it counts until somebody who knows better says so.

Whoever reads a version for long registers in the same way (readers.py). In a bucket its branch leads to the version
that it reads, and so keeps that by itself.
"""

from __future__ import annotations

import json
import logging
import os
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import icechunk
from ulid import ULID

from handsight.datasets.address import DEFAULT_REF, S3Prefix
from handsight.datasets.errors import CorruptDataError, RefNotFoundError, StorageError, pasteable
from handsight.datasets.held import HeldFile, is_held, remove_abandoned
from handsight.datasets.store.files import names_in
from handsight.datasets.store.icechunk_engine import icechunk_errors, is_missing_ref
from handsight.datasets.store.leftovers import WRITERS_FOLDER
from handsight.datasets.store.refs import ref_names
from handsight.datasets.store.releases import DRAFT_PREFIX, READER_PREFIX, WRITER_PREFIX
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.writable import refuse_unwritable

_COARSEST_FILE_TIME = timedelta(seconds=2)
_FARTHEST_CLOCK = timedelta(minutes=15)
"""An object store refuses requests from clocks that are further off than this."""
_ULID = re.compile(r"[0-7][0-9A-HJKMNP-TV-Z]{25}")
_BRANCH = re.compile(rf"(?:{re.escape(WRITER_PREFIX)}|{re.escape(READER_PREFIX)})({_ULID.pattern})\.(.*)-(\d+)")

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Writer:
    """Somebody who is, or in a bucket may be, writing to a dataset, or reading a version of it for long."""

    id: str
    what: str
    """What it does, such as ``import grasps.hdf5``; elsewhere no more is known than whether it writes or reads."""
    session: str | None
    """The session that it records; None for any other work."""
    host: str
    pid: int
    begun: datetime
    """UTC. Nothing that it has written is older, by the clock of the disk or bucket."""
    reads: str | None = None
    """Snapshot id of the version that it reads; None for one that writes."""


class Registration:
    """A writer's entry among those at work, until it is closed or its process ends."""

    def __init__(self, repository: GraspRepository, writer_id: str, held: HeldFile, branch: str | None) -> None:
        self._repository = repository
        self._held = held
        self._branch = branch
        self.id = writer_id

    def close(self) -> None:
        """Take the entry back; nothing happens the second time."""
        branch, self._branch = self._branch, None
        if branch is not None:
            try:
                _delete_branch(self._repository, branch)
            except (CorruptDataError, StorageError) as error:
                path = self._repository.path
                freeing = pasteable("handsight", "dataset", "gc", path, "--ignore-writer", self.id)
                _log.warning("%s; what it keeps is freed by %s", error, freeing)
        self._held.release()


def register(repository: GraspRepository, what: str, *, session: str | None = None) -> Registration:
    """Enter a writer among those at work, before it writes anything.

    Args:
        repository: The dataset.
        what: What it does, for people.
        session: The session that it records, if it does.

    Raises:
        DatasetBusyError: Garbage is being collected, for too long.
        StorageError: The disk is not writable, or the bucket not within reach.
    """
    refuse_unwritable(repository.path)
    # A collection that goes on has looked for writers already.
    with repository.locked():
        return _enter(repository, WRITER_PREFIX, None, {"what": what, "session": session})


def register_reader(repository: GraspRepository, snapshot_id: str, what: str) -> Registration:
    """Enter somebody who reads a version for long among those at work.

    It waits for nobody: expiry and collection leave alone for now what a name leads to, and look for readers anew when
    they come again.

    Args:
        repository: The dataset.
        snapshot_id: The version that is read.
        what: What it does, for people.

    Raises:
        StorageError: The disk is not writable, or the bucket not within reach.
    """
    if not isinstance(repository.path, S3Prefix):
        _forget_dead_readers(repository.side_folder / WRITERS_FOLDER)
    return _enter(repository, READER_PREFIX, snapshot_id, {"what": what, "reads": snapshot_id})


def _forget_dead_readers(folder: Path) -> None:
    """Whoever only reads takes no commit lock, at which entries of killed processes are cleared otherwise."""
    for file in _files(folder):
        entry = _from_file(file)
        if entry is not None and entry.reads is not None:  # That of a writer may have a draft, which goes before it.
            with suppress(OSError):
                remove_abandoned(file)


@contextmanager
def at_work(repository: GraspRepository, what: str) -> Iterator[str]:
    """While the block runs, what it writes is kept by whoever collects garbage or expires commits.

    The block is told the id of its entry.

    Raises:
        DatasetBusyError, StorageError: As for :func:`register`.
    """
    registration = register(repository, what)
    try:
        yield registration.id
    finally:
        registration.close()


def writers_at_work(repository: GraspRepository) -> list[Writer]:
    """Everybody who is, or may be, writing, in the order in which they began.

    In a local dataset those are processes that are alive, on whatever machine, as far as file locks reach.

    Raises:
        StorageError: The disk cannot be read, or the bucket is not within reach.
    """
    folder = repository.side_folder / WRITERS_FOLDER
    if not isinstance(repository.path, S3Prefix):
        return [one for file in _files(folder) if is_held(file) and (one := _from_file(file)) is not None]
    found = []
    for branch, writer in _branches(repository).items():
        if branch.startswith(READER_PREFIX):
            try:
                reads = repository.tip(branch)
            except RefNotFoundError:
                continue  # It has just ended.
            writer = replace(writer, what="read", reads=reads)
        file = folder / f"{writer.id}.json"
        if is_held(file):
            # Of a process of this machine the file says more.
            told = _from_file(file)
            found.append(writer if told is None else replace(writer, what=told.what, session=told.session))
    return sorted(found, key=lambda writer: writer.id)


def forget_dead_writers(repository: GraspRepository, ignored: frozenset[str] = frozenset()) -> None:
    """Take back the entries and the drafts of writers that are surely gone, and of those that are known to be.

    Args:
        repository: The dataset.
        ignored: Ids of writers to a bucket that somebody knows to be gone.

    Raises:
        StorageError: The disk cannot be read, or the bucket is not within reach.
    """
    folder = repository.side_folder / WRITERS_FOLDER
    if isinstance(repository.path, S3Prefix):
        alive = set()
        for branch, writer in _branches(repository).items():
            if writer.id in ignored or not is_held(folder / f"{writer.id}.json"):
                _delete_branch(repository, branch)
            else:
                alive.add(writer.id)
        for draft in _drafts(repository):
            if draft.removeprefix(DRAFT_PREFIX) not in alive:
                _delete_branch(repository, draft)
    for file in _files(folder):
        with suppress(OSError):
            remove_abandoned(file)


def _enter(
    repository: GraspRepository, prefix: str, snapshot_id: str | None, said: dict[str, str | None]
) -> Registration:
    writer_id = str(ULID())
    in_bucket = isinstance(repository.path, S3Prefix)
    pid, host = os.getpid(), socket.gethostname()
    said |= {"host": host, "begun": _moment_of(writer_id).isoformat()}
    folder = repository.side_folder / WRITERS_FOLDER
    held = _held(folder, writer_id, json.dumps({**said, "pid": pid}), outlives_loss=in_bucket)
    branch = None
    if in_bucket:
        branch = f"{prefix}{writer_id}.{re.sub('[^A-Za-z0-9_-]', '-', host)[:64]}-{pid}"
        try:
            with icechunk_errors(f"cannot register with {repository.path}"):
                engine = repository.icechunk_repository
                engine.create_branch(branch, snapshot_id or engine.lookup_branch(DEFAULT_REF))
        except (CorruptDataError, StorageError):
            held.release()
            raise
    return Registration(repository, writer_id, held, branch)


def _held(folder: Path, writer_id: str, content: str, *, outlives_loss: bool) -> HeldFile:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return HeldFile(folder / f"{writer_id}.json", content, outlives_loss=outlives_loss)
    except OSError as error:
        raise StorageError(
            f"cannot register as a writer in {folder}: {error.strerror}; check that the disk is writable and not full"
        ) from error


def _files(folder: Path) -> list[Path]:
    """Entries of writers and readers of this machine, oldest first.

    Raises:
        StorageError: The folder cannot be listed. Nobody is at work only where that is known.
    """
    files = [folder / name for name in names_in(folder, "")]
    return [file for file in files if file.suffix == ".json" and _ULID.fullmatch(file.stem)]


def _from_file(file: Path) -> Writer | None:
    """What a writer of this machine said; None when it has just ended."""
    said: dict[str, Any] = {}
    try:
        changed = file.stat().st_mtime
        with suppress(ValueError):  # It has not said it yet.
            said = json.loads(file.read_text(encoding="utf-8"))
    except OSError:
        return None
    return Writer(
        id=file.stem,
        what=said.get("what", "write"),
        session=said.get("session"),
        host=said.get("host", ""),
        pid=said.get("pid", 0),
        # By both clocks: a file server has its own, and that one dates the chunks.
        begun=min(_moment_of(file.stem), datetime.fromtimestamp(changed, UTC)) - _COARSEST_FILE_TIME,
        reads=said.get("reads"),
    )


def _branches(repository: GraspRepository) -> dict[str, Writer]:
    return {name: writer for name in _names(repository) if (writer := _from_branch(name)) is not None}


def _drafts(repository: GraspRepository) -> list[str]:
    return [name for name in _names(repository) if name.startswith(DRAFT_PREFIX)]


def _names(repository: GraspRepository) -> list[str]:
    return ref_names(repository.path)[1]


def _from_branch(name: str) -> Writer | None:
    match = _BRANCH.fullmatch(name)
    if match is None:
        return None
    return Writer(
        id=match[1],
        what="write",
        session=None,
        host=match[2],
        pid=int(match[3]),
        begun=_moment_of(match[1]) - _FARTHEST_CLOCK,
    )


def _delete_branch(repository: GraspRepository, branch: str) -> None:
    with icechunk_errors(f"cannot take back the entry {branch} of a writer to {repository.path}"):
        try:
            repository.icechunk_repository.delete_branch(branch)
        except icechunk.IcechunkError as error:
            if not is_missing_ref(error):  # Somebody else has taken it back.
                raise


def _moment_of(writer_id: str) -> datetime:
    return datetime.fromtimestamp(ULID.from_str(writer_id).timestamp, UTC)
