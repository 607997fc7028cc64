"""Stored attempts read back, hashed again and compared with the digests that were recorded with them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from numpy.typing import NDArray

from handsight.datasets.errors import CorruptDataError
from handsight.datasets.format.arrays import Arrays, group_at, read_range
from handsight.datasets.format.digest import attempt_digest
from handsight.datasets.format.frames import BATCH_FRAMES, read_frames
from handsight.datasets.format.rows import Row, from_row
from handsight.datasets.format.schema import COLUMNS, SESSIONS, VIEWPOINTS, Viewpoint, attempt_id, attempt_ids
from handsight.datasets.format.sessions import SessionInfo
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import RgbdFrame
from handsight.datasets.writing.batches import chunk_start, column_paths, session_arrays


class AttemptRange(NamedTuple):
    """Neighbouring attempts of a session."""

    session: str
    start: int
    stop: int
    """The number after the last."""

    def cut(self, size: int) -> list[AttemptRange]:
        """The same in pieces of so many attempts; the last may have fewer."""
        starts = range(self.start, self.stop, size)
        return [self._replace(start=start, stop=min(start + size, self.stop)) for start in starts]

    def ids(self) -> list[str]:
        """The attempts by id."""
        return attempt_ids(self.session, range(self.start, self.stop))


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """What was found of some attempts."""

    attempts: int
    bytes: int
    """Of pictures and columns that were hashed, uncompressed."""
    faults: dict[str, str]
    """Why an attempt is corrupt, by its id."""

    @classmethod
    def merged(cls, parts: Iterable[Checked]) -> Checked:
        """What was found of all of them."""
        known = list(parts)
        return cls(
            attempts=sum(part.attempts for part in known),
            bytes=sum(part.bytes for part in known),
            faults={attempt: fault for part in known for attempt, fault in part.faults.items()},
        )


class AttemptChecker:
    """Checks attempts of one version. Ranges are best given in order: columns are kept until others are needed."""

    def __init__(self, dataset: GraspDataset) -> None:
        self._root = dataset.root
        self._sessions = {session.ulid: session for session in dataset.sessions}
        self._arrays: dict[str, Arrays] = {}
        self._columns = _ColumnChunk(session="", first=0, values={})

    def check(self, attempts: AttemptRange) -> Checked:
        """Read every byte of some attempts, which lie in one chunk of the columns."""
        try:
            self._read_columns(attempts)
        except CorruptDataError as error:
            return _corrupt(attempts, error)
        return Checked.merged(map(self._check_batch, attempts.cut(BATCH_FRAMES)))

    def _read_columns(self, attempts: AttemptRange) -> None:
        if attempts.session not in self._arrays:
            self._arrays[attempts.session] = session_arrays(group_at(self._root, f"{SESSIONS}/{attempts.session}"))
        arrays = self._arrays[attempts.session]
        size = arrays["attempts/number"].chunks[0]
        first = chunk_start(attempts.start, size)
        if (self._columns.session, self._columns.first) != (attempts.session, first) or not self._columns.values:
            last = min(first + size, self._sessions[attempts.session].attempts)
            values = {path: read_range(arrays[path], first, last) for path in column_paths()}
            self._columns = _ColumnChunk(session=attempts.session, first=first, values=values)

    def _check_batch(self, batch: AttemptRange) -> Checked:
        """Attempts whose pictures are decoded together; one by one where that fails."""
        try:
            frames = {viewpoint: self._frames(batch, viewpoint) for viewpoint in VIEWPOINTS}
        except CorruptDataError as error:
            pieces = batch.cut(1)
            return Checked.merged(map(self._check_batch, pieces)) if len(pieces) > 1 else _corrupt(batch, error)
        return Checked.merged(
            self._check_attempt(
                batch.session, number, {viewpoint: frames[viewpoint][number - batch.start] for viewpoint in VIEWPOINTS}
            )
            for number in range(batch.start, batch.stop)
        )

    def _frames(self, batch: AttemptRange, viewpoint: Viewpoint) -> list[RgbdFrame]:
        arrays, start, stop = self._arrays[batch.session], batch.start, batch.stop
        poses = self._columns.rows(f"{viewpoint}/pose_base_tool", start, stop)
        return read_frames(arrays, viewpoint, start, stop, poses=poses)

    def _check_attempt(self, ulid: str, number: int, pictures: Mapping[Viewpoint, RgbdFrame]) -> Checked:
        row = {column.name: self._columns.rows(f"attempts/{column.name}", number, number + 1)[0] for column in COLUMNS}
        taken = dict(zip(VIEWPOINTS, row["picture_taken"], strict=True))
        frames = {viewpoint: pictures[viewpoint] if taken[viewpoint] else None for viewpoint in VIEWPOINTS}
        fault = _fault(self._sessions[ulid], number, row, frames)
        size = sum(values.nbytes for values in row.values())
        size += sum(one.rgb.nbytes + one.depth.nbytes for one in frames.values() if one is not None)
        return Checked(attempts=1, bytes=size, faults={attempt_id(ulid, number): fault} if fault else {})


@dataclass(frozen=True, slots=True, kw_only=True)
class _ColumnChunk:
    """One chunk of every column of a session."""

    session: str
    first: int
    """Number of the attempt in its first row."""
    values: dict[str, NDArray[Any]]
    """By path in the session's group."""

    def rows(self, path: str, start: int, stop: int) -> NDArray[Any]:
        return self.values[path][start - self.first : stop - self.first]


def _corrupt(attempts: AttemptRange, error: CorruptDataError) -> Checked:
    faults = dict.fromkeys(attempts.ids(), str(error))
    return Checked(attempts=len(faults), bytes=0, faults=faults)


def _fault(session: SessionInfo, number: int, row: Row, frames: Mapping[Viewpoint, RgbdFrame | None]) -> str | None:
    if int(row["number"]) != number:
        return f"row {number} holds the number {int(row['number'])}"
    try:
        found = attempt_digest(from_row(row, frames), session.header.station)
    except (ValueError, IndexError) as error:
        return f"its values make no attempt: {error}"
    recorded = row["digest"].tobytes()
    if found != recorded:
        return f"its content has digest {found.hex()[:16]}…, recorded was {recorded.hex()[:16]}…"
    return None
