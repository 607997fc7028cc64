"""Recording a session: validated attempts in, commits out."""

from __future__ import annotations

from functools import partial
from types import TracebackType
from typing import Any

import numpy as np
import zarr
from ulid import ULID

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import (
    HeaderError,
    SessionConflictError,
    SessionNotFoundError,
    counted,
)
from handsight.datasets.format.arrays import (
    Arrays,
    Layouts,
    array_at,
    arrays_with,
    group_at,
    layouts_of,
    read_rows,
    run_concurrently,
)
from handsight.datasets.format.frames import EncodedFrames, FrameEncoder
from handsight.datasets.format.schema import COLUMN_CHUNK_ROWS, SESSIONS, attempt_id, create_arrays, packed_rows
from handsight.datasets.format.sessions import (
    matching_sessions,
    new_session_attributes,
    open_attributes,
    sealed_attributes,
)
from handsight.datasets.format.validation import header_faults
from handsight.datasets.records import GraspAttempt, SessionHeader
from handsight.datasets.store.icechunk_engine import icechunk_errors
from handsight.datasets.store.layout import check_current
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.store.transactions import on_the_tip
from handsight.datasets.store.writers import Registration, register
from handsight.datasets.writing.batches import (
    Columns,
    LastChunks,
    column_writes,
    frame_writes,
    new_layouts,
    prepare,
    read_last_chunks,
    rechunk_columns,
    session_arrays,
)

_DIGEST = "attempts/digest"


class SessionWriter:
    """The one writer of a session.

    Attempts are appended one by one, which compresses their pictures, and stored by :meth:`commit`, all of them in one
    snapshot. Until then they are held in memory, about 1 MB for an attempt with two pictures of 640x480; commit every
    few dozen.

    As a context manager it commits what is left on a clean exit. After an exception it drops what was appended since
    the last commit, and nothing else.

    From its making until it is sealed or closed, or its process ends, it is registered as a writer at work, so that
    collecting garbage and expiring commits keep what it has written.
    """

    def __init__(
        self,
        repository: GraspRepository,
        header: SessionHeader,
        *,
        session: str,
        branch: str,
        layouts: Layouts,
        stored: int = 0,
        last_chunks: LastChunks | None = None,
    ) -> None:
        self.repository = repository
        self.header = header
        self.session = session
        self.branch = branch
        self._stored = stored
        self._layouts = layouts
        self._last_chunks = last_chunks or {}
        self._encoder = FrameEncoder(layouts)
        self._in_doubt = False
        """Whether a commit ended in an error, or by Ctrl-C, and may have been done all the same."""
        self._registration: Registration | None = None
        self._register()
        self._rows: list[Columns] = []
        self._frames: list[EncodedFrames] = []

    @classmethod
    def begin(cls, repository: GraspRepository, header: SessionHeader, branch: str = DEFAULT_REF) -> SessionWriter:
        """Start a new session. It shows in the dataset from the first commit on.

        Raises:
            HeaderError: The header cannot be recorded.
            RefNotFoundError: There is no such branch.
            SessionConflictError: The branch holds a session with the same source, seed and configuration, which
                would record the same attempts. Sessions without a seed never repeat each other.
        """
        _check_header(header)
        writer = cls(repository, header, session=str(ULID()), branch=branch, layouts=new_layouts(header))
        try:
            writer._refuse_repetition(_branch_root(repository, branch))
        except BaseException:
            writer.close()
            raise
        return writer

    @classmethod
    def resume(cls, repository: GraspRepository, header: SessionHeader, branch: str = DEFAULT_REF) -> SessionWriter:
        """Go on with the latest session that has the header's source, seed and configuration.

        A sealed session may be resumed too; it is open again from the next commit on.

        Raises:
            HeaderError: The header cannot be recorded.
            RefNotFoundError: There is no such branch.
            SessionNotFoundError: No session matches.
        """
        _check_header(header)
        root = _branch_root(repository, branch)
        matches = matching_sessions(root, header)
        if not matches:
            raise SessionNotFoundError(
                f"branch {branch!r} of {repository.path} has no session of {header.station.source} with seed "
                f"{header.seed} and this configuration to resume: start it without --resume"
            )
        session = matches[-1]
        arrays = session_arrays(group_at(root, f"{SESSIONS}/{session.ulid}"))
        return cls(
            repository,
            session.header,
            session=session.ulid,
            branch=branch,
            layouts=layouts_of(arrays),
            stored=session.attempts,
            last_chunks=read_last_chunks(arrays, stored=session.attempts),
        )

    @property
    def next_number(self) -> int:
        """The number that the next attempt must have."""
        return self._stored + len(self._rows)

    def append(self, attempt: GraspAttempt) -> str:
        """Take an attempt, compress its pictures and return its id. It is stored by the next commit.

        Raises:
            RecordError: The attempt cannot be recorded; the message lists every fault and nothing has changed.
        """
        self.repository.check_process()
        prepared = prepare(attempt, self.header, session=self.session, number=self.next_number)
        frames = self._encoder.encode(prepared.frames)
        self._rows.append(prepared.columns)
        self._frames.append(frames)
        return attempt_id(self.session, attempt.number)

    def commit(self, message: str = "") -> str | None:
        """Store what was appended as one snapshot, durably, and return its id; None when there was nothing.

        After an error nothing of it is stored, and what was appended is still there to be committed again.

        Raises:
            SessionConflictError: Another process went on with this session, or began the same.
            StorageError: The disk is full or not writable.
            DatasetBusyError: Another process held the commit lock for too long.
        """
        return self._commit(message, open_attributes()) if self._rows else None

    def seal(self, message: str = "") -> str | None:
        """Commit what is left and mark the session as complete. A session without attempts leaves no trace.

        Raises:
            SessionConflictError: As for :meth:`commit`; so are the other errors.
        """
        snapshot_id = self._commit(message, sealed_attributes()) if self.next_number else None
        self.close()
        return snapshot_id

    def close(self) -> None:
        """Be at work no longer, whatever was appended; a later commit is at work again."""
        registration, self._registration = self._registration, None
        if registration is not None:
            registration.close()

    def __enter__(self) -> SessionWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self.commit()
        finally:
            self.close()
        self._drop_appended()

    def _register(self) -> None:
        if self._registration is None:
            self._registration = register(self.repository, f"record session {self.session}", session=self.session)

    def _commit(self, message: str, attributes: dict[str, Any]) -> str:
        self._register()
        return on_the_tip(self.repository, self.branch, partial(self._commit_to, message, attributes))

    def _commit_to(self, message: str, attributes: dict[str, Any], transaction: Any) -> str:
        snapshot_id: str = transaction.snapshot_id
        with icechunk_errors(f"cannot write to {self.repository.path}"):
            root = zarr.open_group(transaction.store, mode="r+")
            if self._take_as_stored(root) and attributes["status"] == "open":
                return snapshot_id
            added = len(self._rows)
            group, arrays = self._open(root)
            group.update_attributes(attributes)  # Even if they say the same, so that two writers collide.
            last_chunks = self._last_chunks
            if added:
                writes, last_chunks = column_writes(arrays, self._rows, stored=self._stored, last_chunks=last_chunks)
                run_concurrently([*frame_writes(arrays, self._frames, stored=self._stored), *writes])
            if attributes["status"] == "sealed":
                rechunk_columns(group, packed_rows("sealed", self.next_number))
        if not transaction.has_uncommitted_changes:
            return snapshot_id  # Sealed again within the second: Icechunk refuses an empty commit.
        if not message:
            verb = "seal" if attributes["status"] == "sealed" else "record"
            message = f"{verb} session {self.session}, {counted(added, 'attempt')}"
        self._in_doubt = True
        snapshot_id = self.repository.commit(
            transaction,
            branch=self.branch,
            message=message,
            metadata={"attempts_added": added, "session": self.session},
            check=None if self._stored else self._refuse_repetition,
        )
        self._stored += added
        self._last_chunks = last_chunks
        self._layouts = layouts_of(arrays)
        self._drop_appended()
        self._in_doubt = False
        return snapshot_id

    def _take_as_stored(self, root: zarr.Group) -> bool:
        """Whether what was appended is stored already, by a commit that was interrupted once the branch had moved."""
        path = f"{SESSIONS}/{self.session}"
        if not self._in_doubt or not self._rows or (not self._stored and path not in root):
            return False
        group = group_at(root, path)
        digests = array_at(group, _DIGEST)
        if digests.shape[0] != self.next_number:
            return False
        appended = np.stack([row[_DIGEST] for row in self._rows])
        if not np.array_equal(read_rows(digests, self._stored, self.next_number), appended):
            return False
        arrays = session_arrays(group)
        self._stored = self.next_number
        self._last_chunks = read_last_chunks(arrays, stored=self._stored)
        self._layouts = layouts_of(arrays)
        self._drop_appended()
        return True

    def _drop_appended(self) -> None:
        self._rows.clear()
        self._frames.clear()

    def _open(self, root: zarr.Group) -> tuple[zarr.Group, Arrays]:
        """The session's group, created by the first commit, so that an aborted start leaves nothing behind."""
        if not self._stored:
            group = group_at(root, SESSIONS).create_group(self.session, attributes=new_session_attributes(self.header))
            create_arrays(group, self.header)
            return group, self._as_left(group)
        group = group_at(root, f"{SESSIONS}/{self.session}")
        found = array_at(group, "attempts/number").shape[0]
        if found != self._stored:
            raise SessionConflictError(
                f"session {self.session} has {counted(found, 'attempt')}, this writer knows of {self._stored}: another "
                "process went on with it; stop one of the two, then go on with --resume"
            )
        if group.attrs["status"] == "sealed":
            rechunk_columns(group, COLUMN_CHUNK_ROWS)  # It may be packed.
            return group, session_arrays(group)
        return group, self._as_left(group)

    def _as_left(self, group: zarr.Group) -> Arrays:
        """The session's arrays: nobody but this writer changes them, so there is no need to read how they are."""
        return arrays_with(self._layouts, group.store, group.path)

    def _refuse_repetition(self, root: zarr.Group) -> None:
        if self.header.seed is None:
            return
        for session in matching_sessions(root, self.header):
            raise SessionConflictError(
                f"branch {self.branch!r} of {self.repository.path} already holds session {session.ulid} of "
                f"{session.header.station.source} with seed {self.header.seed} and this configuration "
                f"({counted(session.attempts, 'attempt')}): go on with it by --resume, or choose another seed"
            )


def _check_header(header: SessionHeader) -> None:
    faults = header_faults(header)
    if faults:
        raise HeaderError(f"the session header is refused: {'; '.join(faults)}")


def _branch_root(repository: GraspRepository, branch: str) -> zarr.Group:
    root = zarr.open_group(repository.writable(branch).store, mode="r+")
    check_current(repository.path, branch, root)
    return root
