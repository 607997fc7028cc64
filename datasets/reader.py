"""Reading one version of a dataset."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
import zarr
from numpy.typing import NDArray

from handsight.datasets.address import DatasetAddress
from handsight.datasets.digest import dataset_digest
from handsight.datasets.engine import array_at, group_at, read_rows
from handsight.datasets.errors import (
    AttemptNotFoundError,
    CorruptDataError,
    SessionNotFoundError,
    SnapshotNotFoundError,
)
from handsight.datasets.info import DatasetInfo, bytes_on_disk
from handsight.datasets.records import GraspAttempt, Outcome, Snapshot, StationCard
from handsight.datasets.repository import GraspRepository
from handsight.datasets.rows import from_row
from handsight.datasets.schema import (
    COLUMNS,
    SCHEMA_VERSION,
    SESSIONS,
    VIEWS,
    View,
    attempt_id,
    parse_attempt_id,
)
from handsight.datasets.sessions import SessionInfo, read_sessions
from handsight.datasets.table import attempts_table

_BLOCK_FRAMES = 16
"""Frames decoded at a time by :meth:`GraspDataset.snapshots`, about 25 MB at 640x480."""


class GraspDataset:
    """One version of a dataset, read-only. What others commit later does not show in it."""

    def __init__(self, repository: GraspRepository, *, ref: str) -> None:
        self.repository = repository
        self.ref = ref
        self.snapshot_id = repository.resolve(ref)
        self._root = repository.root(self.snapshot_id)
        self._sessions = {session.ulid: session for session in read_sessions(self._root)}

    @classmethod
    def open(cls, address: str | DatasetAddress) -> GraspDataset:
        """Open ``PATH[@REF]``; without a ref, the branch ``main``.

        Raises:
            AddressError: The text is no address.
            DatasetNotFoundError: Nothing is there.
            NotADatasetError: The path is a file or a folder that is no dataset.
            RefNotFoundError: There is no such version.
            SchemaError: The dataset was written by a newer handsight.
        """
        parsed = DatasetAddress.parse(address) if isinstance(address, str) else address
        return cls(GraspRepository.open(parsed.path), ref=parsed.ref)

    @property
    def sessions(self) -> tuple[SessionInfo, ...]:
        """The sessions in the order in which they began."""
        return tuple(self._sessions.values())

    @cached_property
    def attempts(self) -> pd.DataFrame:
        """One row for each attempt, indexed by its id; see ``table.attempts_table`` for the columns."""
        return attempts_table([(session, self._columns(session.ulid)) for session in self.sessions])

    @cached_property
    def digest(self) -> str:
        """The content of this version, as 64 hexadecimal digits; see ``digest``. Reads no pictures."""
        rows = (self._column(session.ulid, "digest") for session in self.sessions)
        return dataset_digest(digest.tobytes() for session_rows in rows for digest in session_rows)

    def info(self) -> DatasetInfo:
        """A summary of this version. Reads no pictures."""
        outcomes = self.attempts["outcome"].value_counts()
        targets = self.attempts["target"].value_counts()
        catalogue = {name for session in self.sessions for name in session.header.station.objects}
        return DatasetInfo(
            attempts=len(self.attempts),
            successes=int(outcomes.get("held", 0)),
            excluded=0,
            snapshot=self.snapshot_id,
            ref=self.ref,
            schema_version=SCHEMA_VERSION,
            bytes=bytes_on_disk(self.repository.path),
            digest=self.digest,
            sessions=len(self._sessions),
            outcomes={outcome.name.lower(): int(outcomes.get(outcome.name.lower(), 0)) for outcome in Outcome},
            objects={name: int(targets.get(name, 0)) for name in sorted(catalogue)},
        )

    def session(self, key: str) -> SessionInfo:
        """The session with that ULID, or the one that recorded the attempt with that id.

        Raises:
            SessionNotFoundError: There is no such session.
        """
        ulid = key.partition("-")[0]
        if ulid not in self._sessions:
            raise SessionNotFoundError(f"{self._name} has no session {ulid!r} ({len(self._sessions)} sessions)")
        return self._sessions[ulid]

    def station(self, key: str) -> StationCard:
        """The station card of a session, named by its ULID or by an attempt of it.

        Raises:
            SessionNotFoundError: There is no such session.
        """
        return self.session(key).header.station

    def attempt(self, attempt: str) -> GraspAttempt:
        """Everything recorded of an attempt, as it was appended.

        Raises:
            AttemptNotFoundError: There is no such attempt.
            CorruptDataError: Its bytes are damaged.
        """
        ulid, number = self._locate(attempt)
        row = {column.name: self._column(ulid, column.name, number, number + 1)[0] for column in COLUMNS}
        snapshots: dict[View, Snapshot | None] = dict.fromkeys(VIEWS)
        for view, taken in zip(VIEWS, row["picture_taken"], strict=True):
            if taken:
                ((_, snapshots[view]),) = self._read_run(view, ulid, number, number + 1)
        return from_row(row, snapshots)

    def snapshot(self, attempt: str, view: View = "overhead") -> Snapshot:
        """One picture of an attempt.

        Raises:
            AttemptNotFoundError: There is no such attempt.
            SnapshotNotFoundError: The attempt never got to take the picture.
            CorruptDataError: Its bytes are damaged.
        """
        ((_, snapshot),) = self.snapshots(view, [attempt])
        return snapshot

    def snapshots(self, view: View, ids: Iterable[str] | None = None) -> Iterator[tuple[str, Snapshot]]:
        """The pictures of a view, one after another, in the order of the ids; a few frames are in memory at a time.

        Without ids, those of all attempts that took one. Neighbouring attempts are read together, so ids in the order
        of the table are read fastest.

        Raises:
            AttemptNotFoundError: There is no such attempt.
            SnapshotNotFoundError: An attempt among the ids never got to take the picture.
            CorruptDataError: The bytes of a picture are damaged; the message names the attempt.
        """
        taken = self._taken(view)
        located = taken if ids is None else [self._locate(attempt) for attempt in ids]
        missing = sorted(set(located) - set(taken))
        if missing:
            names = ", ".join(attempt_id(*one) for one in missing[:5])
            more = "" if len(missing) <= 5 else f" and {len(missing) - 5} more"
            raise SnapshotNotFoundError(f"{self._name} has no {view} picture of {names}{more}: never taken")
        return self._read_runs(view, located)

    @property
    def _name(self) -> str:
        return f"{self.repository.path}@{self.ref}"

    def _locate(self, attempt: str) -> tuple[str, int]:
        ulid, number = parse_attempt_id(attempt)
        if ulid not in self._sessions or number >= self._sessions[ulid].attempts:
            raise AttemptNotFoundError(f"{self._name} has no attempt {attempt!r}: see 'handsight dataset ls'")
        return ulid, number

    def _taken(self, view: View) -> list[tuple[str, int]]:
        at = VIEWS.index(view)
        return [
            (session.ulid, int(number))
            for session in self.sessions
            for number in np.flatnonzero(self._column(session.ulid, "picture_taken")[:, at])
        ]

    def _read_runs(self, view: View, located: list[tuple[str, int]]) -> Iterator[tuple[str, Snapshot]]:
        first = 0
        for last, (ulid, number) in enumerate(located):
            full = last + 1 - first == _BLOCK_FRAMES
            if full or last + 1 == len(located) or located[last + 1] != (ulid, number + 1):
                yield from self._read_run(view, ulid, located[first][1], number + 1)
                first = last + 1

    def _read_run(self, view: View, ulid: str, start: int, stop: int) -> list[tuple[str, Snapshot]]:
        """The pictures of neighbouring attempts; when one is damaged, the error names its attempt."""
        group = self._group(ulid)
        try:
            rgb, depth, poses = (
                read_rows(array_at(group, f"{view}/{name}"), start, stop) for name in ("rgb", "depth", "pose_base_tool")
            )
        except CorruptDataError as error:
            if stop - start > 1:
                for number in range(start, stop):
                    self._read_run(view, ulid, number, number + 1)
                raise
            raise CorruptDataError(f"attempt {attempt_id(ulid, start)}: {error}") from error
        return [
            (
                attempt_id(ulid, start + at),
                Snapshot(rgb=rgb[at], depth=depth[at], pose_base_tool=poses[at]),
            )
            for at in range(stop - start)
        ]

    def _columns(self, ulid: str) -> dict[str, NDArray[Any]]:
        return {column.name: self._column(ulid, column.name) for column in COLUMNS}

    def _column(self, ulid: str, name: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        array = array_at(self._group(ulid), f"attempts/{name}")
        return read_rows(array, start, array.shape[0] if stop is None else stop)

    def _group(self, ulid: str) -> zarr.Group:
        self.repository.check_process()
        return group_at(self._root, f"{SESSIONS}/{ulid}")
