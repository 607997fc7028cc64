"""Snapshots by the beginnings of their ids."""

from __future__ import annotations

import re
from collections.abc import Iterable

import icechunk

_BEGINNING = re.compile(r"[0-9A-HJKMNP-TV-Z]{4,19}", re.IGNORECASE)
"""Shorter ones are more likely slips of the pen."""


def is_beginning(text: str) -> bool:
    """Whether the id of a snapshot can begin so; upper and lower case are the same."""
    return _BEGINNING.fullmatch(text) is not None


def snapshots_beginning(engine: icechunk.Repository, text: str, tips: Iterable[str]) -> list[str]:
    """Ids in the history of any tip that begin with a text, sorted."""
    known = {commit.id for tip in set(tips) for commit in engine.ancestry(snapshot_id=tip)}
    return sorted(one for one in known if one.startswith(text.upper()))
