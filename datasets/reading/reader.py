"""Reading one version of a dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
import pandas as pd
import zarr
from numpy.typing import NDArray

from handsight.datasets.address import DatasetAddress
from handsight.datasets.errors import (
    AttemptNotFoundError,
    CorruptDataError,
    FrameNotFoundError,
    SessionNotFoundError,
    counted,
    pasteable,
)
from handsight.datasets.format.arrays import array_at, group_at
from handsight.datasets.format.attempts_table import LazyColumns, attempts_table, targets_in_catalogue
from handsight.datasets.format.decisions import CURATED_COLUMNS, Overlay, read_overlay
from handsight.datasets.format.digest import dataset_digest
from handsight.datasets.format.frames import BATCH_FRAMES, frame_arrays, read_frames
from handsight.datasets.format.rows import from_row
from handsight.datasets.format.schema import (
    COLUMNS,
    SCHEMA_VERSION,
    SESSIONS,
    VIEWPOINTS,
    Viewpoint,
    attempt_id,
    parse_attempt_id,
)
from handsight.datasets.format.scores import score_columns, scored
from handsight.datasets.format.sessions import SessionInfo, read_sessions
from handsight.datasets.format.stored_values import impossible, read_column
from handsight.datasets.reading.info import DatasetInfo, bytes_stored
from handsight.datasets.records import GraspAttempt, Outcome, RgbdFrame, StationSpec
from handsight.datasets.store.layout import check_current
from handsight.datasets.store.readers import unless_removed
from handsight.datasets.store.repository import GraspRepository


class GraspDataset:
    """One version of a dataset, read-only. What others commit later does not show in it.

    Where ``expire`` and ``gc`` remove the version meanwhile, reading raises ``VersionRemovedError``.
    """

    def __init__(self, repository: GraspRepository, *, ref: str) -> None:
        self.repository = repository
        self.ref = ref
        self.snapshot_id, self._root = repository.version(ref)
        check_current(repository.path, ref, self._root)
        self._sessions = {session.ulid: session for session in read_sessions(self._root)}
        # A version never changes, and to look what a group or an array is takes half a millisecond.
        self._groups: dict[str, zarr.Group] = {}
        self._arrays: dict[tuple[str, str], zarr.Array[Any]] = {}

    @classmethod
    def open(cls, address: str | DatasetAddress) -> GraspDataset:
        """Open ``PATH[@REF]``; without a ref, the branch ``main``.

        Raises:
            AddressError: The text is no address.
            DatasetNotFoundError: Nothing is there.
            NotADatasetError: The path is a file or a folder that is no dataset.
            RefNotFoundError: There is no such version.
            SchemaError: The version was written by a newer handsight, or by an older one and not migrated.
        """
        parsed = DatasetAddress.parse(address) if isinstance(address, str) else address
        return cls(GraspRepository.open(parsed.path, check=False), ref=parsed.ref)

    @property
    def root(self) -> zarr.Group:
        """The root group of the version, read-only, for what this class has no method for.

        Raises:
            ForkedProcessError: Another process opened the dataset.
        """
        self.repository.check_process()
        return self._root

    @property
    def sessions(self) -> tuple[SessionInfo, ...]:
        """The sessions in the order in which they began."""
        return tuple(self._sessions.values())

    @cached_property
    def attempts(self) -> pd.DataFrame:
        """One row for each attempt, indexed by its id, with curation laid over it.

        See ``attempts_table.attempts_table`` for the columns, ``Overlay.applied_to`` for those of curation, and
        ``scores`` for those of networks.
        """
        return self._table(self._lazy_columns())

    def table(self, *names: str) -> pd.DataFrame:
        """Some columns of :attr:`attempts`, made without the others: for a version of many attempts.

        Raises:
            KeyError: There is no such column.
        """
        return self._table(self._lazy_columns(), names)

    def rows(self, ids: Iterable[str], names: Sequence[str] | None = None) -> pd.DataFrame:
        """Some rows of :attr:`attempts`, in its order; ids that are not there are left out.

        Args:
            ids: Of the attempts wanted.
            names: Columns to make; None for all.
        """
        wanted: dict[str, set[int]] = {}
        for attempt in ids:
            ulid, number = parse_attempt_id(attempt)
            wanted.setdefault(ulid, set()).add(number)
        pairs: list[tuple[SessionInfo, LazyColumns]] = []
        for session in self.sessions:
            numbers = np.array(sorted(one for one in wanted.get(session.ulid, ()) if one < session.attempts), np.int64)
            if len(numbers):
                pairs.append((session, LazyColumns(partial(self._chosen, session.ulid, numbers))))
        return self._table(pairs, names)

    def column(self, session: str, name: str) -> NDArray[Any]:
        """One stored column of a session, as in ``schema.COLUMNS``, with the rows first.

        Raises:
            SessionNotFoundError: There is no such session.
            CorruptDataError: Its bytes are damaged.
        """
        return self._column(self.session(session).ulid, name)

    def targets(self, session: str) -> NDArray[np.int64]:
        """Index of each attempt's target in the session's catalogue, whose length stands for none. Shape (N,)."""
        info = self.session(session)
        index = targets_in_catalogue(info, LazyColumns(partial(self._column, info.ulid)))
        return np.where(index < 0, len(info.header.station.objects), index)

    def tail(self, count: int, names: Sequence[str] | None = None) -> pd.DataFrame:
        """The last rows of :attr:`attempts`, made without the others; ``names`` as in :meth:`rows`."""
        return self._table(self._lazy_columns(last=count), names)

    @cached_property
    def overlay(self) -> Overlay:
        """The decisions of curation in this version."""
        return read_overlay(self.root)

    @property
    def curation_digest(self) -> str:
        """What curation makes of the content of this version; see ``Overlay.digest``."""
        names = ("success", "excluded", "digest")
        return self.overlay.digest(self.table(*names) if self.overlay.decisions else self.tail(0))

    @cached_property
    def digest(self) -> str:
        """The content recorded, as 64 hexadecimal digits, see ``digest``; no curation changes it. Reads no pictures."""
        return dataset_digest(self._column(session.ulid, "digest").tobytes() for session in self.sessions)

    def info(self) -> DatasetInfo:
        """A summary of this version. Reads no pictures."""
        outcomes, targets = self._outcomes(), self._targets()
        successes, excluded = outcomes[Outcome.HELD], 0
        if self.overlay.decisions:
            table = self.table("success", "excluded")
            successes = int((table["success"].fillna(False) & ~table["excluded"]).sum())
            excluded = int(table["excluded"].sum())
        catalogue = {name for session in self.sessions for name in session.header.station.objects}
        return DatasetInfo(
            attempts=sum(session.attempts for session in self.sessions),
            successes=successes,
            excluded=excluded,
            snapshot=self.snapshot_id,
            ref=self.ref,
            schema_version=SCHEMA_VERSION,
            bytes=bytes_stored(self.repository),
            digest=self.digest,
            curation_digest=self.curation_digest,
            sessions=len(self._sessions),
            outcomes={outcome.name.lower(): outcomes[outcome] for outcome in Outcome},
            objects={name: targets[name] for name in sorted(catalogue)},
        )

    def session(self, key: str) -> SessionInfo:
        """The session with that ULID, or the one that recorded the attempt with that id.

        Raises:
            SessionNotFoundError: There is no such session.
        """
        ulid = key.partition("-")[0]
        if ulid not in self._sessions:
            raise SessionNotFoundError(
                f"{self._name} has no session {ulid!r} ({counted(len(self._sessions), 'session')})"
            )
        return self._sessions[ulid]

    def station(self, key: str) -> StationSpec:
        """The station spec of a session, named by its ULID or by an attempt of it.

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
        frames: dict[Viewpoint, RgbdFrame | None] = dict.fromkeys(VIEWPOINTS)
        for viewpoint, taken in zip(VIEWPOINTS, row["picture_taken"], strict=True):
            if taken:
                ((_, frames[viewpoint]),) = self._read_range(viewpoint, ulid, number, number + 1)
        return from_row(row, frames)

    def frame(self, attempt: str, viewpoint: Viewpoint = "overhead") -> RgbdFrame:
        """One picture of an attempt.

        Raises:
            AttemptNotFoundError: There is no such attempt.
            FrameNotFoundError: The attempt never got to take the picture.
            CorruptDataError: Its bytes are damaged.
        """
        ((_, frame),) = self.frames(viewpoint, [attempt])
        return frame

    def frames(self, viewpoint: Viewpoint, ids: Iterable[str] | None = None) -> Iterator[tuple[str, RgbdFrame]]:
        """The frames of a viewpoint, one after another, in the order of the ids; a few of them are in memory at a time.

        Without ids, those of all attempts that took one. Neighbouring attempts are read together, so ids in the order
        of the table are read fastest.

        Raises:
            AttemptNotFoundError: There is no such attempt.
            FrameNotFoundError: An attempt among the ids never got to take the picture.
            CorruptDataError: The bytes of a picture are damaged; the message names the attempt.
        """
        taken = self._taken(viewpoint)
        located = taken if ids is None else [self._locate(attempt) for attempt in ids]
        missing = sorted(set(located) - set(taken))
        if missing:
            names = ", ".join(attempt_id(*one) for one in missing[:5])
            more = "" if len(missing) <= 5 else f" and {len(missing) - 5} more"
            raise FrameNotFoundError(f"{self._name} has no {viewpoint} picture of {names}{more}: never taken")
        return self._read_ranges(viewpoint, located)

    @property
    def _name(self) -> str:
        return f"{self.repository.path}@{self.ref}"

    def _locate(self, attempt: str) -> tuple[str, int]:
        ulid, number = parse_attempt_id(attempt)
        if ulid not in self._sessions or number >= self._sessions[ulid].attempts:
            listing = pasteable("handsight", "dataset", "ls", self._name)
            raise AttemptNotFoundError(f"{self._name} has no attempt {attempt!r}: see {listing}")
        return ulid, number

    def _taken(self, viewpoint: Viewpoint) -> list[tuple[str, int]]:
        at = VIEWPOINTS.index(viewpoint)
        return [
            (session.ulid, int(number))
            for session in self.sessions
            for number in np.flatnonzero(self._column(session.ulid, "picture_taken")[:, at])
        ]

    def _read_ranges(self, viewpoint: Viewpoint, located: list[tuple[str, int]]) -> Iterator[tuple[str, RgbdFrame]]:
        first = 0
        for last, (ulid, number) in enumerate(located):
            full = last + 1 - first == BATCH_FRAMES
            if full or last + 1 == len(located) or located[last + 1] != (ulid, number + 1):
                yield from self._read_range(viewpoint, ulid, located[first][1], number + 1)
                first = last + 1

    def _read_range(self, viewpoint: Viewpoint, ulid: str, start: int, stop: int) -> list[tuple[str, RgbdFrame]]:
        """The pictures of neighbouring attempts; when one is damaged, the error names its attempt."""
        try:
            with unless_removed(self.repository, self.snapshot_id):
                frames = read_frames(frame_arrays(self._group(ulid), viewpoint), viewpoint, start, stop)
        except CorruptDataError as error:
            if stop - start > 1:
                for number in range(start, stop):
                    self._read_range(viewpoint, ulid, number, number + 1)
                raise
            raise CorruptDataError(f"attempt {attempt_id(ulid, start)}: {error}") from error
        for number, frame in enumerate(frames, start):
            if not np.isfinite(frame.pose_base_tool).all():
                raise impossible(ulid, number, f"{viewpoint}/pose_base_tool", frame.pose_base_tool, "finite numbers")
        return [(attempt_id(ulid, number), frame) for number, frame in enumerate(frames, start)]

    def _chosen(self, ulid: str, numbers: NDArray[np.int64], name: str) -> NDArray[Any]:
        first, last = int(numbers[0]), int(numbers[-1])
        return self._column(ulid, name, first, last + 1)[numbers - first]

    def _outcomes(self) -> Counter[int]:
        """How many attempts ended in each way, without the table, which takes a second for a million rows."""
        counts: Counter[int] = Counter()
        for ulid in self._sessions:
            counts.update(dict(enumerate(np.bincount(self._column(ulid, "outcome")).tolist())))
        return counts

    def _targets(self) -> Counter[str]:
        """How many attempts were made on each object, by name."""
        counts: Counter[str] = Counter()
        for ulid, session in self._sessions.items():
            objects = session.header.station.objects
            counted = np.bincount(self.targets(ulid), minlength=len(objects) + 1).tolist()
            counts.update(dict(zip(objects, counted, strict=False)))
        return counts

    def _table(
        self, columns: Sequence[tuple[SessionInfo, LazyColumns]], names: Sequence[str] | None = None
    ) -> pd.DataFrame:
        """The attempts whose columns are given, with curation laid over them; ``names`` chooses and orders columns."""
        conditions = sorted({name for session in self.sessions for name in session.header.station.conditions})
        recorded, scores = None, self._score_columns
        if names is not None:  # What curation lays over the table needs the recorded label.
            scores = [name for name in scores if name in names]
            laid_over = {*CURATED_COLUMNS, *scores}
            recorded = dict.fromkeys(["success", *(name for name in names if name not in laid_over)])
        curated = self.overlay.applied_to(attempts_table(columns, recorded, conditions=conditions))
        if scores:
            curated = scored(curated, self.root, scores)
        return curated if names is None else curated[list(names)]

    @cached_property
    def _score_columns(self) -> list[str]:
        return score_columns(self.root)

    def _lazy_columns(self, last: int | None = None) -> list[tuple[SessionInfo, LazyColumns]]:
        """The sessions and their columns, or those of their last attempts, read when they are asked for."""
        pairs: list[tuple[SessionInfo, LazyColumns]] = []
        left = sum(session.attempts for session in self.sessions) if last is None else last
        for session in reversed(self.sessions):
            start = max(0, session.attempts - left)
            left -= session.attempts - start
            if start < session.attempts:
                read = partial(self._column, session.ulid, start=start)
                pairs.insert(0, (session, LazyColumns(read)))
        return pairs

    def _column(self, ulid: str, name: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        with unless_removed(self.repository, self.snapshot_id):
            self.repository.check_process()
            if (ulid, name) not in self._arrays:
                self._arrays[ulid, name] = array_at(self._group(ulid), f"attempts/{name}")
            return read_column(self._arrays[ulid, name], name, self._sessions[ulid], start, stop)

    def _group(self, ulid: str) -> zarr.Group:
        self.repository.check_process()
        if ulid not in self._groups:
            self._groups[ulid] = group_at(self.root, f"{SESSIONS}/{ulid}")
        return self._groups[ulid]
