"""Whether the names of versions are those that were given: the ledger against what Icechunk finds.

A release is a small file. When it is lost, Icechunk knows nothing of it any more, and the next garbage collection takes
what only it led to. The ledger, a branch with history and checksums of its own, still knows the name and the snapshot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import icechunk

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import CorruptDataError, headline, pasteable
from handsight.datasets.machine import of_the_machine
from handsight.datasets.store.icechunk_engine import icechunk_errors
from handsight.datasets.store.refs import is_deleted_tag
from handsight.datasets.store.releases import (
    DRAFT_PREFIX,
    LEDGER_BRANCH,
    confirmed_releases,
    is_registration,
    known_branches,
)
from handsight.datasets.store.repository import GraspRepository


@dataclass(frozen=True, slots=True, kw_only=True)
class LostRef:
    """A release or a branch that is not what the ledger says."""

    kind: str
    """``release``, ``branch`` or ``ledger``."""
    name: str
    snapshot_id: str | None
    """What was released, or where the branch began; None where the ledger does not know."""
    fault: str
    """What is wrong, and what to do."""


def lost_refs(repository: GraspRepository) -> list[LostRef]:
    """Releases and branches that the ledger knows and that are gone, damaged, or lead elsewhere.

    Without the ledger nothing is known of the others, so that it is the only one then.

    Raises:
        CorruptDataError, StorageError: What the ledger holds cannot be read.
    """
    engine = repository.icechunk_repository
    with icechunk_errors(f"cannot list the branches of {repository.path}"):
        listed = LEDGER_BRANCH in engine.list_branches()
    wrong = _what_is_wrong(repository, engine.lookup_branch, LEDGER_BRANCH, listed=listed, expected=None)
    if wrong:
        fault = f"the list of releases of {repository.path} {wrong}: {_repair(repository)} gives it back"
        return [LostRef(kind="ledger", name=LEDGER_BRANCH, snapshot_id=None, fault=fault)]
    return [*_lost_releases(repository), *_lost_branches(repository)]


def refuse_lost_refs(repository: GraspRepository, action: str) -> None:
    """Refuse to delete anything while a name is lost, because what it led to would go with it.

    Raises:
        CorruptDataError: Names are lost; the message lists them.
    """
    lost = lost_refs(repository)
    if lost:
        raise CorruptDataError(f"{action} is refused: {'; '.join(one.fault for one in lost)}")


def _lost_releases(repository: GraspRepository) -> Iterator[LostRef]:
    path = repository.path
    engine = repository.icechunk_repository
    with icechunk_errors(f"cannot list the releases of {path}"):
        tags = engine.list_tags()
    released = confirmed_releases(repository.ledger())
    for name in sorted({*tags, *released}):
        expected = released.get(name)
        wrong = _what_is_wrong(repository, engine.lookup_tag, name, listed=name in tags, expected=expected)
        if not wrong or (name in released and is_deleted_tag(path, name)):
            continue
        remedy = f"put refs/tag.{name} back from a copy"
        if expected is not None and repository.has_snapshot(expected):
            remedy = f"it was {expected}, which it is given again by {_repair(repository)}"
        fault = f"release {name!r} of {path} {wrong}: {remedy}"
        yield LostRef(kind="release", name=name, snapshot_id=expected, fault=fault)


def _lost_branches(repository: GraspRepository) -> Iterator[LostRef]:
    path = repository.path
    engine = repository.icechunk_repository
    with icechunk_errors(f"cannot list the branches of {path}"):
        present = {one for one in engine.list_branches() if one != LEDGER_BRANCH and not one.startswith(DRAFT_PREFIX)}
    known = known_branches(repository.ledger())
    for name in sorted({DEFAULT_REF, *present, *known}):
        if is_registration(name):  # It comes and goes without the ledger.
            continue
        wrong = _what_is_wrong(repository, engine.lookup_branch, name, listed=name in present, expected=None)
        if not wrong:
            continue
        began = known.get(name)
        fault = f"branch {name!r} of {path} {wrong}: {_repair(repository)} gives it its newest commit again"
        yield LostRef(kind="branch", name=name, snapshot_id=began, fault=fault)


def _repair(repository: GraspRepository) -> str:
    return pasteable("handsight", "dataset", "repair", repository.path, "--branch", "repaired")


def _what_is_wrong(
    repository: GraspRepository, lookup: Callable[[str], str], name: str, *, listed: bool, expected: str | None
) -> str:
    """What is wrong with a name, empty where nothing is. A branch may lead anywhere, so nothing is expected of it."""
    try:
        found = lookup(name)
    except icechunk.IcechunkError as error:
        if trouble := of_the_machine(f"{name!r} of {repository.path} cannot be looked up", error):
            raise trouble from error
        return f"cannot be read ({headline(error)})" if listed else "is gone"
    if expected is not None and found != expected:
        return f"leads to {found}, and {expected} was released"
    return "" if repository.has_snapshot(found) else f"leads to {found}, which is not there"
