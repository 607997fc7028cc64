"""Triangles that lie on one another: which of them a surface can do without.

A triangle twice the same way round is one too many. Twice, once each way, it is the wall between two bodies that have
grown together, which goes as a whole; or one side of a surface that was written for viewers that draw one side only,
of which the side that was written first counts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def without_repeats(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """The places of the triangles to keep, in their order, all of them where none lies on another one.

    Args:
        triangles: corners of each, of which no two are the same. Shape (T, 3).
    """
    # The same triangle may begin at any of its corners.
    start = triangles.argmin(axis=1)
    turned = np.take_along_axis(triangles, (start[:, None] + np.arange(3)) % 3, axis=1)
    once = np.sort(np.unique(turned, axis=0, return_index=True)[1])
    _, first, group, uses = np.unique(
        np.sort(triangles[once], axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    paired = uses[group.reshape(-1)] == 2
    if not paired.any():
        return once
    alone = once[~paired]
    return alone if _closed(triangles[alone]) else once[np.sort(first)]


def _closed(triangles: NDArray[np.int64]) -> bool:
    """Whether every edge joins two triangles."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    uses = np.unique(edges, axis=0, return_counts=True)[1]
    return bool(len(uses)) and bool((uses == 2).all())
