"""Attempts that a network finds alike: what is near one of them, and groups of near-duplicates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

NEAR_DUPLICATE = 0.999
"""Cosine of the features from which two attempts count as near-duplicates."""
_BLOCK = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class SimilarAttempt:
    """An attempt and how much it looks like the one asked about."""

    attempt: str
    similarity: float
    """Cosine of the features, 1 for what the network cannot tell apart."""


def most_similar(features: NDArray[np.float32], ids: list[str], attempt: str) -> list[SimilarAttempt]:
    """All attempts by their likeness to one of them, which comes first.

    Args:
        features: One row for each attempt, each of length one. Shape (N, D).
        ids: Of the rows.
        attempt: The one asked about; among ``ids``.
    """
    at = ids.index(attempt)
    cosines = features @ features[at]  # (N,)
    cosines[at] = np.inf  # Before its copies, which rounding may put a hair nearer.
    order = np.argsort(-cosines, kind="stable")
    cosines[at] = 1.0
    return [SimilarAttempt(attempt=ids[row], similarity=float(min(cosines[row], 1.0))) for row in order.tolist()]


def near_duplicate_groups(
    features: NDArray[np.float32], ids: list[str], *, least: float = NEAR_DUPLICATE
) -> list[list[str]]:
    """Groups of attempts that are joined by pairs of near-duplicates, the largest first.

    Compares all pairs, a block of rows at a time: half a second for ten thousand attempts.

    Args:
        features: One row for each attempt, each of length one. Shape (N, D).
        ids: Of the rows.
        least: Cosine from which two attempts are joined.
    """
    pairs = []
    for start in range(0, len(features), _BLOCK):
        near = features[start : start + _BLOCK] @ features[start:].T >= least  # (B, N - start)
        left, right = np.nonzero(np.triu(near, k=1))
        pairs.append(np.stack([left + start, right + start]))
    left, right = np.concatenate(pairs, axis=1) if pairs else np.empty((2, 0), np.int64)
    joined = coo_array((np.ones(len(left), np.int8), (left, right)), shape=(len(ids), len(ids)))
    _, group_of_row = connected_components(joined, directed=False)
    groups: dict[int, list[str]] = {}
    for row, group in enumerate(group_of_row.tolist()):
        groups.setdefault(group, []).append(ids[row])
    return sorted((one for one in groups.values() if len(one) > 1), key=len, reverse=True)
