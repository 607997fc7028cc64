"""Proof that a whole dataset is as it was recorded: every branch and release, and the books that Icechunk keeps.

Versions share most of their bytes, so a session is read once for all versions that have it from the same files.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from pathlib import Path

import google_crc32c

from handsight.datasets.address import DEFAULT_REF, Location, S3Prefix
from handsight.datasets.errors import CorruptDataError, DatasetError, SchemaError, StorageError
from handsight.datasets.format.schema import SESSIONS
from handsight.datasets.integrity.verify import check_sessions, damage_beside
from handsight.datasets.machine import machine_blamed
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.file_damage import FileDamage
from handsight.datasets.store.inspection import inspect
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.store.version_files import VersionFiles

_REMEDY = "put it back from a copy of the dataset, or let repair replace its attempts"
_CHECKSUM_BYTES = 4
"""At the end of every chunk: its crc32c, little-endian."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AllReport:
    """What a verification of everything found."""

    versions: tuple[str, ...]
    """Branches and releases whose every byte was read."""
    snapshots: int
    """Snapshots that were read with their manifests and transaction logs, ancestors included."""
    checked: int
    """Attempts whose every byte was read; one that several versions share counts once."""
    bytes: int
    """Bytes of pictures and columns that were hashed, uncompressed."""
    faults: dict[str, str]
    """Why an attempt is corrupt, by its id, in whatever version."""
    damaged_in: dict[str, tuple[str, ...]]
    """The branches and releases in which it is, by the id of a corrupt attempt."""
    damage: tuple[str, ...]
    """Damage to what belongs to no single attempt, each with the version that it was found in."""
    files: tuple[FileDamage, ...]
    """Damaged files, as far as they are known by name."""
    lost_refs: tuple[str, ...]
    """Releases and branches that are not what the ledger says, and what to do."""
    unread: tuple[str, ...]
    """Versions that were not read because they were not migrated, and how that is done."""

    @property
    def corrupt(self) -> tuple[str, ...]:
        """Ids of the corrupt attempts."""
        return tuple(self.faults)

    @property
    def ok(self) -> bool:
        """Whether nothing is damaged or lost."""
        return not (self.faults or self.damage or self.files or self.lost_refs)


def verify_all(
    path: Location,
    *,
    jobs: int = 1,
    on_snapshot: Callable[[int], None] | None = None,
    on_checked: Callable[[int, int], None] | None = None,
) -> AllReport:
    """Read every branch, every release, and the files behind them and their ancestors, and name what is damaged.

    Chunks that no branch or release needs, those of superseded commits, are not read.

    Args:
        path: The dataset.
        jobs: Processes at most, as for :func:`~handsight.datasets.integrity.verify.verify`.
        on_snapshot: Called with the number of snapshots read so far.
        on_checked: Called with the number of attempts checked so far, and with the number known to be checked.

    Raises:
        DatasetNotFoundError: Nothing is in the bucket at that prefix.
        StorageError: The machine cannot read, so that what is damaged is not known.
    """
    try:
        repository = GraspRepository.open(path, check=False)
    except CorruptDataError as error:
        return _closed(path, error)
    inspection = inspect(repository, on_snapshot)
    books = tuple(inspection.damage)
    work = _Versions(repository, jobs, on_checked or _nothing)
    for name, tip in inspection.tips.items():
        work.check(name, tip)
    chunks = tuple(_damaged_chunks(path)) if work.faults or work.damage else ()
    return AllReport(
        versions=tuple(work.versions),
        snapshots=inspection.snapshots,
        checked=work.checked,
        bytes=work.bytes,
        faults=work.faults,
        damaged_in={attempt: tuple(names) for attempt, names in work.damaged_in.items()},
        damage=tuple(work.damage),
        files=books + chunks,
        lost_refs=inspection.lost_refs,
        unread=tuple(work.unread),
    )


@dataclass(slots=True)
class _Versions:
    """What has been found of the versions so far."""

    repository: GraspRepository
    jobs: int
    on_checked: Callable[[int, int], None]
    versions: list[str] = field(default_factory=list)
    checked: int = 0
    bytes: int = 0
    faults: dict[str, str] = field(default_factory=dict)
    damaged_in: dict[str, list[str]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    _known: dict[Hashable, list[str]] = field(default_factory=dict)
    """Corrupt attempts of every session that was read, by what files it lies in."""
    _tips: dict[str, str] = field(default_factory=dict)
    """The first version with a snapshot, by that."""

    def check(self, name: str, tip: str) -> None:
        """Read what of a version has not been read for another."""
        try:
            dataset = GraspDataset(self.repository, ref=tip)
            files = VersionFiles(self.repository, tip)
            keys = {one.ulid: files.under(f"{SESSIONS}/{one.ulid}") for one in dataset.sessions}
            new = {ulid: key for ulid, key in keys.items() if key not in self._known}
            due = self.checked + sum(session.attempts for session in dataset.sessions if session.ulid in new)
            done = check_sessions(
                dataset, new, jobs=self.jobs, on_checked=lambda count: self.on_checked(self.checked + count, due)
            )
            beside = list(damage_beside(dataset.root)) if tip not in self._tips else []
        except StorageError:
            raise
        except SchemaError as error:
            self.unread.append(str(error))
            return
        except DatasetError as error:
            self.damage.append(f"{name}: {error}")
            return
        self._tips.setdefault(tip, name)
        self.versions.append(name)
        self.checked += done.attempts
        self.bytes += done.bytes
        self.faults |= done.faults
        for ulid, key in new.items():
            self._known[key] = [attempt for attempt in done.faults if attempt.startswith(f"{ulid}-")]
        for key in keys.values():
            for attempt in self._known[key]:
                self.damaged_in.setdefault(attempt, []).append(name)
        self.damage += [f"{name}: {fault}" for fault in beside]


def _closed(path: Location, error: CorruptDataError) -> AllReport:
    """The report on a dataset of which nothing can be read, because Icechunk cannot begin with it."""
    file = f"refs/branch.{DEFAULT_REF}/ref.json"
    gone = not isinstance(path, S3Prefix) and not (path / file).exists()
    missing = FileDamage(file=file, fault="is missing", needed_by=(DEFAULT_REF,), remedy=f"put {file} back from a copy")
    return AllReport(
        versions=(),
        snapshots=0,
        checked=0,
        bytes=0,
        faults={},
        damaged_in={},
        damage=(str(error),),
        files=(missing,) * gone,
        lost_refs=(),
        unread=(),
    )


def _damaged_chunks(path: Location) -> list[FileDamage]:
    """Files of chunks whose checksum is wrong, to name the file behind a damaged attempt.

    One of them may belong to no version, left cut short by a power cut, so this is asked only once a version is known
    to be damaged.
    """
    if isinstance(path, S3Prefix):
        return []
    found = []
    with machine_blamed(f"{path / 'chunks'} cannot be listed"):
        files = sorted((path / "chunks").iterdir())
    for file in files:
        with machine_blamed(f"{file} cannot be read"):
            if not _is_whole(file):
                fault = "does not have the content that its checksum is of"
                found.append(FileDamage(file=f"chunks/{file.name}", fault=fault, needed_by=(), remedy=_REMEDY))
    return found


def _is_whole(file: Path) -> bool:
    data = file.read_bytes()
    said = int.from_bytes(data[-_CHECKSUM_BYTES:], "little")
    return len(data) >= _CHECKSUM_BYTES and google_crc32c.value(data[:-_CHECKSUM_BYTES]) == said


def _nothing(_checked: int, _due: int) -> None:
    pass
