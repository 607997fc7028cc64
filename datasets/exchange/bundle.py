"""What every format carries: sessions, and what curation decided about their attempts."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from handsight.datasets.errors import DatasetError, InterchangeError, counted
from handsight.datasets.exchange.edits import NO_EDITS, Edits
from handsight.datasets.exchange.sources import SessionSource
from handsight.datasets.format.decisions import Action, Decision, check_value
from handsight.datasets.format.digest import dataset_digest
from handsight.datasets.format.schema import SCHEMA_VERSION, parse_attempt_id
from handsight.datasets.format.sessions import attribute_damage
from handsight.datasets.reading.reader import GraspDataset


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """A foreign dataset, open for reading."""

    sessions: Sequence[SessionSource]
    decisions: Sequence[Decision] = ()
    """Oldest first."""
    preview: dict[str, Any] | None = None
    """What a map makes of a set, as JSON values; None where no map was needed."""
    edits: Edits = NO_EDITS
    """What its user changed after it was exported."""


def origin_of(dataset: GraspDataset) -> dict[str, Any]:
    """Where an export comes from, as JSON values; written into every format that can hold it."""
    root = dataset.root
    return {
        "schema_version": SCHEMA_VERSION,
        "dataset_uuid": root.attrs.get("dataset_uuid"),
        "ref": dataset.ref,
        "snapshot": dataset.snapshot_id,
        "digest": dataset.digest,
    }


def schema_of_origin(origin: object, where: object) -> int:
    """The schema version of an export; older ones are upgraded (format/upgrades.py).

    Raises:
        InterchangeError: It is newer than this handsight's, or none is named.
    """
    version = origin.get("schema_version") if isinstance(origin, dict) else None
    if version is None:
        raise InterchangeError(
            f"{where} has schema version None: it was not exported by handsight; describe a set of other origin in a "
            "map and import it with --map map.toml, or make a table of its pictures (both in docs/datasets.md)"
        )
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise InterchangeError(
            f"{where} has schema version {version!r}, expected 1 to {SCHEMA_VERSION}: it was not exported by handsight"
        )
    if version > SCHEMA_VERSION:
        raise InterchangeError(
            f"{where} has schema version {version}, this handsight reads up to {SCHEMA_VERSION}: upgrade handsight"
        )
    return version


def refuse_changed(origin: dict[str, Any], sessions: Sequence[SessionSource], where: Path) -> None:
    """Refuse an export whose sessions and attempts are not those that were exported, by their recorded digests.

    Raises:
        InterchangeError: What describes a session was changed, or the version that was exported had other attempts.
    """
    changed = [f"session {one.ulid}: {fault}" for one in sessions for fault in attribute_damage(one.attributes)]
    if changed:
        raise InterchangeError(f"{where} was changed after it was exported: {'; '.join(changed[:5])}; export anew")
    attempts = sum(one.size for one in sessions)
    digest = dataset_digest(one for session in sessions for one in session.digests)
    if origin.get("digest", digest) != digest:
        raise InterchangeError(
            f"{where} was changed after it was exported: its {counted(attempts, 'attempt')} in "
            f"{counted(len(sessions), 'session')} are not those of the version that it names; to leave some out, "
            "import all and exclude them, or merge --session"
        )


def refuse_linked(path: Path) -> None:
    """Refuse a folder from which a path could lead out.

    Raises:
        InterchangeError: A file or folder in it is a link.
    """
    for parent, folders, files in os.walk(path):
        for name in (*folders, *files):
            if (Path(parent) / name).is_symlink():
                raise InterchangeError(f"{path} holds a link at {Path(parent) / name}: links are not followed")


def decisions_to_json(decisions: Sequence[Decision]) -> str:
    """Decisions as one JSON text."""
    return json.dumps(
        [
            {
                "action": one.action.name.lower(),
                "value": one.value,
                "reason": one.reason,
                "author": one.author,
                "decided": one.decided.isoformat(),
                "attempts": list(one.attempts),
            }
            for one in decisions
        ]
    )


def decisions_from_json(text: str, where: object) -> tuple[Decision, ...]:
    """The decisions that :func:`decisions_to_json` was given.

    Raises:
        InterchangeError: The text is something else.
    """
    try:
        return tuple(_decision(number, entry) for number, entry in enumerate(json.loads(text)))
    except (KeyError, TypeError, ValueError, AttributeError, DatasetError) as error:
        raise InterchangeError(
            f"the decisions in {where} cannot be read ({type(error).__name__}: {error}), "
            "expected those that handsight exports"
        ) from error


def _decision(number: int, entry: dict[str, Any]) -> Decision:
    for attempt in entry["attempts"]:
        parse_attempt_id(attempt)
    value, action = entry["value"], Action[entry["action"].upper()]
    if value is not None and not isinstance(value, int):
        raise ValueError(f"value is {value!r}")
    check_value(action, value, number)
    return Decision(
        number=number,
        action=action,
        value=value,
        reason=str(entry["reason"]),
        author=str(entry["author"]),
        decided=datetime.fromisoformat(entry["decided"]),
        attempts=tuple(entry["attempts"]),
    )
