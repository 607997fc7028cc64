"""Beginnings of ids, as people read and type them: long enough to tell each id from the others."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise, takewhile

SHORTEST = 8
"""Characters that are shown at least, so that a beginning stays unique when more ids come."""


def telling_length(ids: Iterable[str]) -> int:
    """How many first characters tell each id from the others; ``SHORTEST`` at least."""
    ordered = sorted(set(ids))
    return max(SHORTEST, 1 + max((_alike(*pair) for pair in pairwise(ordered)), default=0))


def _alike(one: str, other: str) -> int:
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(one, other, strict=False)))
