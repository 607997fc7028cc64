"""Giving releases and branches that the disk has lost what they led to.

The ledger knows what was released, and where each branch began. How far a branch has come since, its commits tell:
each says for which branch it was made, and none goes while a name is lost, because garbage is not collected then. A
commit that was stored and that its branch had not reached yet, when its writer was killed, counts as one of the branch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import icechunk

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import counted
from handsight.datasets.held import HeldFolder
from handsight.datasets.machine import machine_blamed
from handsight.datasets.store.agreement import LostRef, lost_refs
from handsight.datasets.store.files import names_in
from handsight.datasets.store.icechunk_engine import icechunk_errors, storage_at
from handsight.datasets.store.layout import FIRST_COMMIT
from handsight.datasets.store.refs import main_is_lost, read_branch, restore_ref
from handsight.datasets.store.releases import LEDGER_BRANCH, confirmed_releases, is_snapshot_id, known_branches
from handsight.datasets.store.repository import GraspRepository

_BRANCH = "branch"
"""Key of a commit's metadata."""

Snapshots = Mapping[str, icechunk.SnapshotInfo]


@dataclass(frozen=True, slots=True, kw_only=True)
class RestoredRef:
    """A release or a branch that was given, or would be given, what it led to."""

    kind: str
    """``release``, ``branch`` or ``ledger``."""
    name: str
    snapshot_id: str
    source: str
    """How that is known, for people."""


def restore_refs(repository: GraspRepository, *, dry_run: bool = False) -> tuple[RestoredRef, ...]:
    """Give lost releases and branches their snapshots again, as far as those are known and there.

    Raises:
        CorruptDataError, StorageError: The ledger cannot be read, or the disk or bucket not be written.
    """
    with nullcontext() if dry_run else repository.locked():
        lost = lost_refs(repository)
        restored = _restore(repository, lost, dry_run=dry_run)
        if restored and not dry_run and lost[0].kind == "ledger":
            restored += _restore(repository, lost_refs(repository), dry_run=False)
    return restored


def _restore(repository: GraspRepository, lost: Sequence[LostRef], *, dry_run: bool) -> tuple[RestoredRef, ...]:
    restored = tuple(found for one in lost if (found := _restorable(repository, one)) is not None)
    for one in restored if not dry_run else ():
        restore_ref(repository.path, "tag" if one.kind == "release" else "branch", one.name, one.snapshot_id)
    return restored


def restore_main(path: Path, *, dry_run: bool = False) -> tuple[RestoredRef, ...]:
    """Give a local dataset its main branch back if that is lost, without which Icechunk does not open it.

    A dry run tells of all that is lost, which cannot be asked for before the main branch is there.

    Raises:
        CorruptDataError, StorageError: The ledger is lost as well, or the disk cannot be written.
    """
    if not main_is_lost(path):
        return ()
    with _without_main(path) as repository, nullcontext() if dry_run else repository.locked():
        found = _restorable(repository, LostRef(kind="branch", name=DEFAULT_REF, snapshot_id=None, fault=""))
        others = _restore(repository, lost_refs(repository), dry_run=True) if dry_run else ()
        if found is None:
            return ()
        if not dry_run:
            restore_ref(path, "branch", DEFAULT_REF, found.snapshot_id)
    return (found, *others)


@contextmanager
def _without_main(path: Path) -> Iterator[GraspRepository]:
    """The dataset as it looks with another main branch, made of links: not one of its own files is changed."""
    stand_in = read_branch(path, LEDGER_BRANCH)
    assert stand_in is not None
    with machine_blamed(f"{path} cannot be looked at without its main branch"), HeldFolder("handsight-look-") as folder:
        for one in path.iterdir():
            if one.name != "refs":
                (folder / one.name).symlink_to(one.resolve())
        (folder / "refs").mkdir()
        for one in (path / "refs").iterdir():
            if one.name != f"branch.{DEFAULT_REF}":
                (folder / "refs" / one.name).symlink_to(one.resolve())
        restore_ref(folder, "branch", DEFAULT_REF, stand_in)
        with icechunk_errors(f"cannot open {path}"):
            yield GraspRepository(folder, icechunk.Repository.open(storage_at(folder)))


def _restorable(repository: GraspRepository, lost: LostRef) -> RestoredRef | None:
    if lost.kind == "release":
        if lost.snapshot_id is None or not repository.has_snapshot(lost.snapshot_id):
            return None
        return RestoredRef(kind="release", name=lost.name, snapshot_id=lost.snapshot_id, source="as the ledger says")
    stored = _stored_snapshots(repository)
    own = [one for one in stored.values() if one.metadata.get(_BRANCH) == lost.name]
    if lost.kind == "ledger":
        found = _newest(own or _old_ledger(repository, stored), stored), "the newest of its commits"
    else:
        found = _tip_of(repository, lost, stored, own)
    commit, source = found
    return None if commit is None else RestoredRef(kind=lost.kind, name=lost.name, snapshot_id=commit.id, source=source)


def _tip_of(
    repository: GraspRepository, lost: LostRef, stored: Snapshots, own: list[icechunk.SnapshotInfo]
) -> tuple[icechunk.SnapshotInfo | None, str]:
    """Where a branch is to lead, and how that is known; ``own`` are the commits that were made to it."""
    began = stored.get(lost.snapshot_id or "")
    own = own or _commits_of_nobody(repository, lost.name, stored, began)
    newest = _newest(own, stored)
    if newest is not None and (began is None or not _is_of_an_earlier_branch(newest, began, stored)):
        return newest, f"the newest of {counted(len(own), 'commit')} made to it that the store holds"
    if began is not None:
        return began, "where it began, as the ledger says; no later commit of it is stored"
    if lost.name != DEFAULT_REF:
        return None, ""
    known = [stored[one] for one in _known_to_ledger(repository) if one in stored]
    return _newest(known, stored), "the newest version that the ledger knows; no later commit of it is stored"


def _stored_snapshots(repository: GraspRepository) -> dict[str, icechunk.SnapshotInfo]:
    """Every snapshot of the store that can be read, whatever leads to it."""
    stored = {}
    for name in names_in(repository.path, "snapshots"):
        if is_snapshot_id(name):
            try:
                stored[name] = repository.icechunk_repository.lookup_snapshot(name)
            except icechunk.IcechunkError:
                continue
    return stored


def _commits_of_nobody(
    repository: GraspRepository, lost: str, stored: Snapshots, began: icechunk.SnapshotInfo | None
) -> list[icechunk.SnapshotInfo]:
    """Commits that no other name leads to, of an older handsight, which did not say for which branch they were made."""
    led_to: set[str] = set()
    for tip in _tips_but(repository, lost):
        for ancestor in _ancestors(tip, stored):
            if ancestor in led_to:
                break
            led_to.add(ancestor)
    return [
        one
        for one in stored.values()
        if _BRANCH not in one.metadata
        and one.id not in led_to
        and one.parent_id is not None
        and (began is None or began.id in _ancestors(one.id, stored))
    ]


def _old_ledger(repository: GraspRepository, stored: Snapshots) -> list[icechunk.SnapshotInfo]:
    """Commits of an older handsight to the ledger, which their messages tell; else the version where it began."""
    entered = [
        one
        for one in _commits_of_nobody(repository, LEDGER_BRANCH, stored, None)
        if one.message.startswith(("release ", "released ", "branch ", "delete branch "))
    ]
    return entered or [one for one in stored.values() if one.message == FIRST_COMMIT]


def _tips_but(repository: GraspRepository, lost: str) -> Iterator[str]:
    engine = repository.icechunk_repository
    lookups: list[tuple[Callable[[str], str], str]]
    lookups = [(engine.lookup_tag, name) for name in sorted(engine.list_tags())]
    lookups += [(engine.lookup_branch, name) for name in sorted(engine.list_branches()) if name != lost]
    for lookup, name in lookups:
        try:
            yield lookup(name)
        except icechunk.IcechunkError:
            continue  # Lost itself.


def _known_to_ledger(repository: GraspRepository) -> Iterator[str]:
    yield from known_branches(repository.ledger()).values()
    yield from (one for one in confirmed_releases(repository.ledger()).values() if one is not None)


def _newest(commits: list[icechunk.SnapshotInfo], stored: Snapshots) -> icechunk.SnapshotInfo | None:
    """The newest of those that none of the others descends from: clocks of several machines differ."""
    older: set[str] = set()
    for one in commits:
        for ancestor in _ancestors(one.parent_id, stored):
            if ancestor in older:
                break  # Those that led to it are known.
            older.add(ancestor)
    leaves = [one for one in commits if one.id not in older]
    return max(leaves, key=lambda one: one.written_at, default=None)


def _is_of_an_earlier_branch(commit: icechunk.SnapshotInfo, began: icechunk.SnapshotInfo, stored: Snapshots) -> bool:
    """Whether a commit is from before the branch began: from another one of its name, which was deleted."""
    return began.id not in _ancestors(commit.id, stored) and began.written_at > commit.written_at


def _ancestors(snapshot_id: str | None, stored: Snapshots) -> Iterator[str]:
    """A snapshot and those that led to it, as far as the store holds them."""
    while snapshot_id is not None and snapshot_id in stored:
        yield snapshot_id
        snapshot_id = stored[snapshot_id].parent_id
