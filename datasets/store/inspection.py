"""Whether the files in which Icechunk keeps its books are whole: configuration, snapshots, manifests, transaction logs.

They have no checksums. What can be compared is what two of them say: a snapshot knows how many chunks its manifests
name, and what changed from one snapshot to the next also stands in the transaction log between them.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import icechunk
from zarr.abc.store import Store
from zarr.core.buffer import default_buffer_prototype
from zarr.core.sync import sync

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import CorruptDataError, DatasetError, StorageError, counted, headline
from handsight.datasets.format.schema import SESSIONS
from handsight.datasets.machine import of_the_machine
from handsight.datasets.store.agreement import lost_refs
from handsight.datasets.store.icechunk_engine import icechunk_config, storage_at
from handsight.datasets.store.releases import LEDGER_BRANCH, is_internal, known_branches
from handsight.datasets.store.repository import GraspRepository

_FROM_A_COPY = "put it back from a copy of the dataset"
_SHOWN = 3
_ARRAYS_AT_A_TIME = 32
"""Each has a file open."""

Extents = tuple[tuple[int, int], ...]
"""The first chunk of a manifest and the one after its last, along every axis of an array."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileDamage:
    """One stored file that is damaged or missing."""

    file: str
    """Its path in the dataset."""
    fault: str
    needed_by: tuple[str, ...]
    """Branches and releases that have it in their history; empty where no version needs it."""
    remedy: str

    def __str__(self) -> str:
        needed = f" (needed by {', '.join(self.needed_by)})" if self.needed_by else ""
        return f"{self.file}{needed} {self.fault}: {self.remedy}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Inspection:
    """What was found of the books of a dataset."""

    damage: tuple[FileDamage, ...]
    lost_refs: tuple[str, ...]
    """Releases and branches that are not what the ledger says, and what to do."""
    tips: dict[str, str]
    """Snapshot of every branch and release that can be read, by name; handsight's own branches are left out."""
    snapshots: int
    """How many were read, ancestors included."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Snapshot:
    """What a snapshot says of itself."""

    id: str
    parent: str | None
    branch: str | None
    """Where it was committed; None where that was not noted."""
    nodes: dict[str, tuple[str, str, tuple[str, ...]]]
    """Id, kind and manifests of every group and array, by path."""
    extents: dict[str, tuple[Extents, ...]]
    """Where the manifests of every array have its chunks, by path."""
    chunk_counts: dict[str, int]
    """How many chunks each manifest names, by its id."""


def inspect(repository: GraspRepository, on_snapshot: Callable[[int], None] | None = None) -> Inspection:
    """Read the configuration, every branch and release, and every snapshot, manifest and transaction log behind them.

    Args:
        repository: The dataset.
        on_snapshot: Called with the number of snapshots read so far.

    Raises:
        StorageError: The machine cannot read, so that what is damaged is not known.
    """
    return _Inspector(repository, on_snapshot or _nothing).inspection()


class VersionFiles:
    """Where a version has its content, so that what two versions share need be read once.

    Raises:
        CorruptDataError: The snapshot cannot be read.
        StorageError: The machine cannot read it.
    """

    def __init__(self, repository: GraspRepository, snapshot_id: str) -> None:
        self._inspector = _Inspector(repository, _nothing)
        self._snapshot = self._inspector.snapshot(snapshot_id)
        self._store = self._inspector.store(snapshot_id)

    def under(self, folder: str) -> Hashable:
        """Versions in which this is equal hold the same bytes under that folder."""
        nodes = {path: one for path, one in self._snapshot.nodes.items() if f"{path}/".startswith(f"/{folder}/")}
        paths = sorted(nodes)
        with self._inspector.reading(folder):
            described = _descriptions(self._store, paths)
        return tuple((path, nodes[path], description) for path, description in zip(paths, described, strict=True))

    def damage(self, asked: Callable[[str], bool]) -> list[FileDamage]:
        """Manifests that cannot be read or name other chunks than the snapshot says, for the arrays asked for by path.

        Raises:
            StorageError: The machine cannot read them.
        """
        nodes = {path: one for path, one in self._snapshot.nodes.items() if asked(path)}
        self._inspector.check_manifests(replace(self._snapshot, nodes=nodes), self._store)
        return self._inspector.damage()


class _Inspector:
    def __init__(self, repository: GraspRepository, on_snapshot: Callable[[int], None]) -> None:
        self._repository = repository
        self._engine = repository.icechunk_repository
        self._on_snapshot = on_snapshot
        self._read: dict[str, _Snapshot | None] = {}
        self._needed_by: dict[str, dict[str, None]] = {}
        """Names of versions by snapshot."""
        self._described: dict[str, dict[str, bytes | None]] = {}
        """Metadata of the groups and arrays beside the attempts, by path, of every snapshot: no checksum covers it."""
        self._manifests: set[str] = set()
        self._found: dict[str, tuple[str, str]] = {}
        """Snapshot that needs it and fault, by file."""

    def inspection(self) -> Inspection:
        self._check_config()
        tips = dict(self._tips())
        for name, tip in tips.items():
            self._walk(name, tip)
        lost = tuple(self._lost_refs(tips))
        return Inspection(
            damage=tuple(self.damage()),
            lost_refs=lost,
            tips={name: tip for name, tip in tips.items() if not is_internal(name)},
            snapshots=sum(one is not None for one in self._read.values()),
        )

    def damage(self) -> list[FileDamage]:
        """What has been found so far."""
        return [
            FileDamage(file=file, fault=fault, needed_by=self._names_of(file, of), remedy=_FROM_A_COPY)
            for file, (of, fault) in self._found.items()
        ]

    def _names_of(self, file: str, snapshot_id: str) -> tuple[str, ...]:
        """Branches and releases that need a file which was found damaged for a snapshot."""
        users = {snapshot_id}
        if file.startswith("manifests/"):
            named = set(file.replace("manifests/", "").split(", "))
            users |= {one for one, found in self._read.items() if found and not named.isdisjoint(found.chunk_counts)}
        return tuple(sorted({name for one in users for name in self._needed_by.get(one, ())}))

    def snapshot(self, snapshot_id: str) -> _Snapshot:
        """What a snapshot says of itself.

        Raises:
            CorruptDataError, StorageError: It cannot be read.
        """
        with self.reading(f"snapshot {snapshot_id}"):
            said = json.loads(self._engine.inspect_snapshot(snapshot_id))
            if said["id"] != snapshot_id:
                raise CorruptDataError(f"says that it is {said['id']}")
            nodes = {
                node["path"]: (
                    node["id"],
                    node["node_type"],
                    tuple(one["id"] for one in node.get("manifest_refs", ())),
                )
                for node in said["nodes"]
            }
            return _Snapshot(
                id=snapshot_id,
                parent=said.get("parent_id"),
                branch=said["metadata"].get("branch"),
                nodes=nodes,
                extents={
                    node["path"]: tuple(
                        tuple((int(first), int(end)) for first, end in one["extents"])
                        for one in node.get("manifest_refs", ())
                    )
                    for node in said["nodes"]
                },
                chunk_counts={one["id"]: one["num_chunk_refs"] for one in said["manifests"]},
            )

    def _check_config(self) -> None:
        try:
            with self.reading("config.yaml"):
                found = icechunk.Repository.fetch_config(storage_at(self._repository.path))
        except CorruptDataError as error:
            self._note("config.yaml", "", str(error))
            return
        if found is None:
            self._note("config.yaml", "", "is missing")
        elif found != icechunk_config():
            self._note("config.yaml", "", "holds other settings than handsight writes")

    def _tips(self) -> Iterator[tuple[str, str]]:
        with self.reading("the list of branches and releases"):
            names = [("branch", name) for name in sorted(self._engine.list_branches())]
            names += [("tag", name) for name in sorted(self._engine.list_tags())]
        if ("branch", LEDGER_BRANCH) not in names:
            self._note(f"refs/branch.{LEDGER_BRANCH}/ref.json", "", "is missing, and with it the ledger of releases")
        for kind, name in names:
            lookup = self._engine.lookup_branch if kind == "branch" else self._engine.lookup_tag
            try:
                with self.reading("ref"):
                    yield name, lookup(name)
            except CorruptDataError as error:
                self._note(f"refs/{kind}.{name}/ref.json", "", str(error))

    def _lost_refs(self, tips: dict[str, str]) -> Iterator[str]:
        path = self._repository.path
        try:
            yield from (one.fault for one in lost_refs(self._repository))
            began = known_branches(self._repository.ledger())
            branches = self._engine.list_branches()
        except StorageError:
            raise
        except DatasetError as error:
            yield f"the ledger of {path} cannot be read, so no name can be compared with it: {error}"
            return
        for name, tip in tips.items():
            found = self._read.get(tip)
            other = None if found is None else found.branch
            if name not in branches or other in (None, name) or other not in branches:
                continue
            # A branch that nobody has committed to leads where it began.
            if name in (DEFAULT_REF, LEDGER_BRANCH) or began.get(name, tip) != tip:
                yield (
                    f"branch {name!r} of {path} leads to {tip}, which was committed to {other!r}: put "
                    f"refs/branch.{name} back from a copy"
                )

    def _walk(self, name: str, tip: str) -> None:
        """Read a version and its ancestors; those that were read before only learn another name."""
        current: str | None = tip
        child: _Snapshot | None = None
        while current is not None:
            known = current in self._read
            self._needed_by.setdefault(current, {})[name] = None
            if not known:
                self._read[current] = self._checked(current)
                self._on_snapshot(len(self._read))
            found = self._read[current]
            if child is not None and found is not None:
                self._check_commit(found, child)
            child = None if known else found
            current = None if found is None else found.parent

    def _checked(self, snapshot_id: str) -> _Snapshot | None:
        """A snapshot, after its manifests have been read; None where it cannot be read."""
        try:
            found = self.snapshot(snapshot_id)
        except CorruptDataError as error:
            self._note(f"snapshots/{snapshot_id}", snapshot_id, str(error))
            return None
        try:
            store = self.store(snapshot_id)
            with self.reading("snapshot"):
                beside = sorted(path for path in found.nodes if not path.startswith(f"/{SESSIONS}/"))
                self._described[snapshot_id] = dict(zip(beside, _descriptions(store, beside), strict=True))
        except CorruptDataError as error:
            self._note(f"snapshots/{snapshot_id}", snapshot_id, str(error))
            return found
        self.check_manifests(found, store)
        return found

    def store(self, snapshot_id: str) -> icechunk.IcechunkStore:
        with self.reading("snapshot"):
            return self._engine.readonly_session(snapshot_id=snapshot_id).store

    def check_manifests(self, snapshot: _Snapshot, store: icechunk.IcechunkStore) -> None:
        """Count what the manifests of a snapshot name that have not been read for another."""
        unread = {
            path: manifests
            for path, (_, kind, manifests) in snapshot.nodes.items()
            if kind == "array" and not self._manifests.issuperset(manifests)
        }
        paths = list(unread)
        counted_chunks: list[int | BaseException] = []
        for start in range(0, len(paths), _ARRAYS_AT_A_TIME):
            extents = {path: snapshot.extents[path] for path in paths[start : start + _ARRAYS_AT_A_TIME]}
            counted_chunks += sync(_chunk_counts(store.session, extents))
        for path, named in zip(paths, counted_chunks, strict=True):
            self._manifests.update(unread[path])
            self._check_manifest(snapshot, path, unread[path], named)

    def _check_manifest(
        self, snapshot: _Snapshot, path: str, manifests: tuple[str, ...], named: int | BaseException
    ) -> None:
        files = ", ".join(f"manifests/{one}" for one in manifests)
        try:
            with self.reading(files):
                if isinstance(named, BaseException):
                    raise named
        except CorruptDataError as error:
            self._note(files, snapshot.id, f"of {path.lstrip('/')} {error}")
            return
        expected = sum(snapshot.chunk_counts.get(one, 0) for one in manifests)
        if named != expected:
            what = f"of {path.lstrip('/')} names {counted(named, 'chunk')} of it, and the snapshot says {expected}"
            self._note(files, snapshot.id, what)

    def _check_commit(self, parent: _Snapshot, child: _Snapshot) -> None:
        """Compare what changed from one snapshot to the next with the transaction log of the latter."""
        log = f"transactions/{child.id}"
        try:
            with self.reading(log):
                said = self._engine.diff(from_snapshot_id=parent.id, to_snapshot_id=child.id)
        except CorruptDataError as error:
            self._note(log, child.id, str(error))
            return
        # Behind Icechunk's own first snapshot, commits between may have expired, of which this log says nothing.
        if parent.parent is not None:
            unlike = list(self._unlike(parent, child, said))
            if unlike:
                more = f" and {len(unlike) - _SHOWN} more" if len(unlike) > _SHOWN else ""
                shown = f"{', '.join(unlike[:_SHOWN])}{more}"
                self._note(log, child.id, f"or a snapshot beside it, {parent.id} or {child.id}, is damaged: {shown}")

    def _unlike(self, parent: _Snapshot, child: _Snapshot, said: icechunk.Diff) -> Iterator[str]:
        before, after = parent.nodes, child.nodes
        kept = {path for path in before.keys() & after.keys() if before[path][:2] == after[path][:2]}
        added, gone = set(said.new_arrays | said.new_groups), set(said.deleted_arrays | said.deleted_groups)
        yield from (f"{path} is new and not in the log" for path in sorted(after.keys() - kept - added))
        yield from (f"{path} is gone and not in the log" for path in sorted(before.keys() - kept - gone))
        yield from (f"{path} is new in the log alone" for path in sorted(added & kept - gone))
        yield from (f"{path} is not there and new in the log" for path in sorted(added - after.keys() - gone))
        rewritten = set(said.updated_chunks)
        touched = rewritten | set(said.updated_arrays | said.updated_groups)
        for path in sorted(kept):
            moved = before[path][2] != after[path][2]
            if moved and path not in touched:
                yield f"{path} has other chunks, which the log does not say"
        yield from (f"{path} is changed in the log and not there" for path in sorted(touched - after.keys() - gone))
        described, before_that = self._described.get(child.id, {}), self._described.get(parent.id, {})
        for path in sorted((described.keys() & before_that.keys() & kept) - touched):
            if described[path] != before_that[path]:
                yield f"{path} is described otherwise, which the log does not say"

    def _note(self, file: str, snapshot_id: str, fault: str) -> None:
        self._found.setdefault(file, (snapshot_id, fault))

    def reading(self, what: str) -> _Reading:
        """A block in which something is read: what it raises is the machine's, or else damage."""
        return _Reading(f"{what} of {self._repository.path} cannot be read")


class _Reading:
    """A block whose errors are those of the machine, or else damage."""

    def __init__(self, trouble: str) -> None:
        self._trouble = trouble

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, DatasetError) or not isinstance(error, Exception):
            return
        if trouble := of_the_machine(self._trouble, error):
            raise trouble from error
        raise CorruptDataError(f"cannot be read ({headline(error)})") from error


async def _chunk_counts(
    session: icechunk.Session, extents: Mapping[str, tuple[Extents, ...]]
) -> list[int | BaseException]:
    """How many chunks the manifests of arrays name where the snapshot has them, or what is raised for one.

    One that a flipped bit has moved elsewhere is not found by whoever reads the array.
    """

    async def count(path: str) -> int:
        found = [one async for one in session.chunk_coordinates(path)]
        return sum(any(_within(one, extent) for extent in extents[path]) for one in found)

    return await asyncio.gather(*map(count, extents), return_exceptions=True)


def _within(chunk: Sequence[int], extent: Extents) -> bool:
    return all(first <= at < end for at, (first, end) in zip(chunk, extent, strict=True))


def _descriptions(store: Store, paths: Sequence[str]) -> list[bytes | None]:
    """Metadata of groups and arrays."""
    return sync(_contents(store, [f"{path.strip('/')}/zarr.json".lstrip("/") for path in paths]))


async def _contents(store: Store, keys: Sequence[str]) -> list[bytes | None]:
    found = await asyncio.gather(*(store.get(key, default_buffer_prototype()) for key in keys))
    return [None if one is None else one.to_bytes() for one in found]


def _nothing(_: int) -> None:
    pass
