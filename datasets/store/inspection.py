"""Whether the files in which Icechunk keeps its books are whole: configuration, snapshots, manifests, transaction logs.

They have no checksums. What can be compared is what two of them say: a snapshot knows how many chunks its manifests
name, and what changed from one snapshot to the next also stands in the transaction log between them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import icechunk

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import CorruptDataError, DatasetError, StorageError
from handsight.datasets.format.schema import SESSIONS
from handsight.datasets.store.agreement import lost_refs
from handsight.datasets.store.file_damage import FileDamage
from handsight.datasets.store.icechunk_engine import icechunk_config, storage_at
from handsight.datasets.store.manifests import manifest_damage
from handsight.datasets.store.releases import LEDGER_BRANCH, is_internal, known_branches
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.store.snapshot_reader import Snapshot, SnapshotReader

_SHOWN = 3


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


def inspect(repository: GraspRepository, on_snapshot: Callable[[int], None] | None = None) -> Inspection:
    """Read the configuration, every branch and release, and every snapshot, manifest and transaction log behind them.

    Args:
        repository: The dataset.
        on_snapshot: Called with the number of snapshots read so far.

    Raises:
        StorageError: The machine cannot read, so that what is damaged is not known.
    """
    return _Inspector(repository, on_snapshot or _nothing).inspection()


class _Inspector:
    def __init__(self, repository: GraspRepository, on_snapshot: Callable[[int], None]) -> None:
        self._repository = repository
        self._engine = repository.icechunk_repository
        self._reader = SnapshotReader(repository)
        self._on_snapshot = on_snapshot
        self._read: dict[str, Snapshot | None] = {}
        self._needed_by: dict[str, dict[str, None]] = {}
        """Names of versions by snapshot."""
        self._described: dict[str, dict[str, bytes | None]] = {}
        """Metadata of the groups and arrays beside the attempts, by path, of every snapshot: no checksum covers it."""
        self._manifests: set[str] = set()
        self._found: dict[str, tuple[str, FileDamage]] = {}
        """Snapshot that needs it and what is wrong, by file."""

    def inspection(self) -> Inspection:
        self._check_config()
        tips = dict(self._tips())
        for name, tip in tips.items():
            self._walk(name, tip)
        return Inspection(
            damage=tuple(replace(one, needed_by=self._names_of(file, of)) for file, (of, one) in self._found.items()),
            lost_refs=tuple(self._lost_refs(tips)),
            tips={name: tip for name, tip in tips.items() if not is_internal(name)},
            snapshots=sum(one is not None for one in self._read.values()),
        )

    def _names_of(self, file: str, snapshot_id: str) -> tuple[str, ...]:
        """Branches and releases that need a file which was found damaged for a snapshot."""
        users = {snapshot_id}
        if file.startswith("manifests/"):
            named = set(file.replace("manifests/", "").split(", "))
            users |= {one for one, found in self._read.items() if found and not named.isdisjoint(found.chunk_counts)}
        return tuple(sorted({name for one in users for name in self._needed_by.get(one, ())}))

    def _check_config(self) -> None:
        try:
            with self._reader.reading("config.yaml"):
                found = icechunk.Repository.fetch_config(storage_at(self._repository.path))
        except CorruptDataError as error:
            self._note("config.yaml", "", str(error))
            return
        if found is None:
            self._note("config.yaml", "", "is missing")
        elif found != icechunk_config():
            self._note("config.yaml", "", "holds other settings than handsight writes")

    def _tips(self) -> Iterator[tuple[str, str]]:
        with self._reader.reading("the list of branches and releases"):
            names = [("branch", name) for name in sorted(self._engine.list_branches())]
            names += [("tag", name) for name in sorted(self._engine.list_tags())]
        if ("branch", LEDGER_BRANCH) not in names:
            self._note(f"refs/branch.{LEDGER_BRANCH}/ref.json", "", "is missing, and with it the ledger of releases")
        for kind, name in names:
            lookup = self._engine.lookup_branch if kind == "branch" else self._engine.lookup_tag
            try:
                with self._reader.reading("ref"):
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
        child: Snapshot | None = None
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

    def _checked(self, snapshot_id: str) -> Snapshot | None:
        """A snapshot, after its manifests have been read; None where it cannot be read."""
        try:
            found = self._reader.snapshot(snapshot_id)
        except CorruptDataError as error:
            self._note(f"snapshots/{snapshot_id}", snapshot_id, str(error))
            return None
        try:
            store = self._reader.store(snapshot_id)
            beside = sorted(path for path in found.nodes if not path.startswith(f"/{SESSIONS}/"))
            self._described[snapshot_id] = self._reader.descriptions(store, beside, f"snapshot {snapshot_id}")
        except CorruptDataError as error:
            self._note(f"snapshots/{snapshot_id}", snapshot_id, str(error))
            return found
        self._check_manifests(found, store)
        return found

    def _check_manifests(self, snapshot: Snapshot, store: icechunk.IcechunkStore) -> None:
        """Count what the manifests of a snapshot name that have not been read for another."""
        manifests = {path: {one.id for one in node.manifests} for path, node in snapshot.nodes.items()}
        unread = [path for path, ids in manifests.items() if not self._manifests.issuperset(ids)]
        for found in manifest_damage(self._reader, snapshot, store, unread):
            self._found.setdefault(found.file, (snapshot.id, found))
        self._manifests.update(*(manifests[path] for path in unread))

    def _check_commit(self, parent: Snapshot, child: Snapshot) -> None:
        """Compare what changed from one snapshot to the next with the transaction log of the latter."""
        log = f"transactions/{child.id}"
        try:
            with self._reader.reading(log):
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

    def _unlike(self, parent: Snapshot, child: Snapshot, said: icechunk.Diff) -> Iterator[str]:
        before, after = parent.nodes, child.nodes
        kept = {path for path in before.keys() & after.keys() if before[path].is_still(after[path])}
        added, gone = set(said.new_arrays | said.new_groups), set(said.deleted_arrays | said.deleted_groups)
        yield from (f"{path} is new and not in the log" for path in sorted(after.keys() - kept - added))
        yield from (f"{path} is gone and not in the log" for path in sorted(before.keys() - kept - gone))
        yield from (f"{path} is new in the log alone" for path in sorted(added & kept - gone))
        yield from (f"{path} is not there and new in the log" for path in sorted(added - after.keys() - gone))
        rewritten = set(said.updated_chunks)
        touched = rewritten | set(said.updated_arrays | said.updated_groups)
        for path in sorted(kept):
            moved = before[path].manifests != after[path].manifests
            if moved and path not in touched:
                yield f"{path} has other chunks, which the log does not say"
        yield from (f"{path} is changed in the log and not there" for path in sorted(touched - after.keys() - gone))
        described, before_that = self._described.get(child.id, {}), self._described.get(parent.id, {})
        for path in sorted((described.keys() & before_that.keys() & kept) - touched):
            if described[path] != before_that[path]:
                yield f"{path} is described otherwise, which the log does not say"

    def _note(self, file: str, snapshot_id: str, fault: str) -> None:
        self._found.setdefault(file, (snapshot_id, FileDamage(file=file, fault=fault)))


def _nothing(_: int) -> None:
    pass
