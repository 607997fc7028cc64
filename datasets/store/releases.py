"""Releases: immutable names for snapshots.

The name is an Icechunk tag on the very snapshot that was released. Tags carry no text, so message and time go into
a ledger, a branch of its own that nobody commits data to; it travels with the dataset and changes no version of it.
The ledger also knows which snapshot a release names and which branches there are, so that a name that the disk has
lost is missed (agreement.py).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import zarr

from handsight.datasets.errors import CorruptDataError, RefNameError

LEDGER_BRANCH = "handsight.releases"
"""Not shown among the branches."""

WRITER_PREFIX = "handsight.writer."
READER_PREFIX = "handsight.reader."
"""Branches that tell who writes to a bucket or reads from it begin so (writers.py); they are not shown either."""

DRAFT_PREFIX = "handsight.draft."
"""Branches that get their name once the work on them is done begin so, before the id of the writer (branches.py)."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_SNAPSHOT_ID = re.compile(r"[0-9A-HJKMNP-TV-Z]{20}")
_LEDGER_KEY = "releases"
_BRANCHES_KEY = "branches"


@dataclass(frozen=True, slots=True, kw_only=True)
class Release:
    """One released version."""

    name: str
    snapshot_id: str
    message: str
    released_at: datetime | None
    """UTC; None for a tag that was not made by handsight."""


def is_snapshot_id(text: str) -> bool:
    """Whether the text has the form of a snapshot id."""
    return _SNAPSHOT_ID.fullmatch(text) is not None


def is_internal(branch: str) -> bool:
    """Whether a branch is handsight's own and no version of the dataset."""
    return branch == LEDGER_BRANCH or branch.startswith(DRAFT_PREFIX) or is_registration(branch)


def is_registration(branch: str) -> bool:
    """Whether a branch stands for somebody at work in a bucket."""
    return branch.startswith((WRITER_PREFIX, READER_PREFIX))


def is_plain_name(name: str) -> bool:
    """Whether the text can name something in a dataset: 1 to 64 letters, digits, '.', '_' or '-'."""
    return _NAME.fullmatch(name) is not None


def check_name(kind: str, name: str) -> None:
    """Refuse a name for something in a dataset that :func:`is_plain_name` does not hold for.

    Raises:
        RefNameError: The rule is in the message.
    """
    if not is_plain_name(name):
        raise RefNameError(f"{kind} name is {name!r}, expected 1 to 64 letters, digits, '.', '_' or '-'")


def check_ref_name(kind: str, name: str) -> None:
    """Refuse a name for a release or a branch that could not be typed in an address or told from a snapshot id.

    Raises:
        RefNameError: Both rules are in the message.
    """
    if not is_plain_name(name) or is_snapshot_id(name) or is_internal(name):
        raise RefNameError(
            f"{kind} name is {name!r}, expected 1 to 64 letters, digits, '.', '_' or '-', beginning with a letter "
            "or digit and not in the form of a snapshot id: choose a name such as v1"
        )


def read_ledger(root: zarr.Group, tags: dict[str, str]) -> dict[str, Release]:
    """The releases behind the tags, a mapping from name to snapshot id, sorted by name."""
    entries = _entries(root)
    return {name: _release(name, tags[name], entries.get(name)) for name in sorted(tags)}


def add_to_ledger(root: zarr.Group, release: Release, *, pending: bool) -> None:
    """Write a release into the ledger; it shows once its tag exists.

    Args:
        root: The ledger's root group.
        release: What was released, or is about to be.
        pending: Whether the tag may not exist yet. Without it nobody will take a missing tag for an unfinished release.
    """
    when = None if release.released_at is None else release.released_at.isoformat()
    entry: dict[str, Any] = {"message": release.message, "released_at": when, "snapshot": release.snapshot_id}
    if pending:
        entry["pending"] = True
    root.update_attributes({_LEDGER_KEY: {**_entries(root), release.name: entry}})


def confirmed_releases(root: zarr.Group) -> dict[str, str | None]:
    """Snapshot id of every release whose tag has been made, by name; None where an older handsight left it out."""
    return {name: entry.get("snapshot") for name, entry in sorted(_entries(root).items()) if not entry.get("pending")}


def known_branches(root: zarr.Group) -> dict[str, str]:
    """The snapshot where each branch began, by name; of branches that an older handsight made nothing is known."""
    return _stored(root, _BRANCHES_KEY, lambda began: isinstance(began, str))


def enter_branch(root: zarr.Group, name: str, snapshot_id: str | None) -> None:
    """Write into the ledger that a branch exists and where it began or, with None, that it is to be no more."""
    others = {one: began for one, began in known_branches(root).items() if one != name}
    root.update_attributes({_BRANCHES_KEY: others if snapshot_id is None else {**others, name: snapshot_id}})


def _entries(root: zarr.Group) -> dict[str, dict[str, Any]]:
    return _stored(root, _LEDGER_KEY, _is_release)


def _is_release(entry: object) -> bool:
    return isinstance(entry, dict) and isinstance(entry.get("snapshot"), str | None)


def _stored(root: zarr.Group, key: str, sound: Callable[[object], bool]) -> dict[str, Any]:
    """What the ledger says of each name.

    Raises:
        CorruptDataError: It says something else than handsight writes.
    """
    said: Any = root.attrs.asdict().get(key, {})
    strange = [] if isinstance(said, dict) else ["all of them"]
    strange = strange or [name for name, entry in said.items() if not sound(entry)]
    if strange:
        raise CorruptDataError(
            f"the ledger's entries of {key} are damaged ({', '.join(map(str, strange[:5]))}): restore the dataset from "
            "a copy"
        )
    return dict(said)


def _release(name: str, snapshot_id: str, entry: dict[str, Any] | None) -> Release:
    if entry is None:
        return Release(name=name, snapshot_id=snapshot_id, message="", released_at=None)
    try:
        message, when = str(entry["message"]), entry["released_at"]
        released_at = None if when is None else datetime.fromisoformat(when)
    except (KeyError, TypeError, ValueError) as error:
        raise CorruptDataError(
            f"the ledger's entry of release {name!r} is damaged ({error!r}): restore the dataset from a copy"
        ) from error
    return Release(name=name, snapshot_id=snapshot_id, message=message, released_at=released_at)
