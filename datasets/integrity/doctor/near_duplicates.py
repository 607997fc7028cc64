"""GD-307 and GD-403: near-duplicates among pictures.

A picture is reduced to 17x16 grey cells; each bit of its hash says whether a cell is brighter than its right
neighbour, a difference hash of 256 bits. Pictures within a few bits show the same scene. To find such pairs without
comparing all, hashes are cut into eight bands: two that differ in fewer bits than there are bands agree in one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import combinations, pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.datasets.curation.folds import Folds
from handsight.datasets.errors import counted
from handsight.datasets.integrity.doctor.findings import Finding, attempt_finding

NEAR_BITS = 7
"""Most bits in which the hashes of two near-duplicates differ; fewer than there are bands."""

_SIDE = 16
_BANDS = 8
_BAND_BITS = _SIDE * _SIDE // _BANDS
_GREY_STEP = 2.0
"""Smaller differences between cells are noise."""


def picture_hash(rgb: NDArray[np.uint8]) -> int:
    """The difference hash of a picture, 256 bits. ``rgb`` has shape (H, W, 3)."""
    grey = rgb.mean(axis=2, dtype=np.float32)
    cells = cv2.resize(grey, (_SIDE + 1, _SIDE), interpolation=cv2.INTER_AREA)
    bits = cells[:, :-1] - cells[:, 1:] > _GREY_STEP
    return int.from_bytes(np.packbits(bits).tobytes(), "big")


def near_pairs(hashes: Mapping[str, int]) -> Iterator[tuple[str, str]]:
    """Pairs of names whose hashes differ in at most ``NEAR_BITS`` bits, each once.

    Of names with the very same hash only neighbours are paired, so that many copies of one picture stay linear.
    """
    names = defaultdict(list)
    for name, value in hashes.items():
        names[value].append(name)
    for same in names.values():
        yield from pairwise(same)
    buckets: dict[tuple[int, int], list[int]] = defaultdict(list)
    mask = (1 << _BAND_BITS) - 1
    for value in names:
        for band in range(_BANDS):
            buckets[band, value >> band * _BAND_BITS & mask].append(value)
    found = set()
    for members in buckets.values():
        for left, right in combinations(members, 2):
            if (left ^ right).bit_count() <= NEAR_BITS and (left, right) not in found:
                found.add((left, right))
                yield names[left][0], names[right][0]


def near_duplicate_findings(hashes: Mapping[str, int], folds: list[Folds]) -> Iterator[Finding]:
    """Near-duplicates among overhead pictures, and pairs of them that are in two folds."""
    pairs = list(near_pairs(hashes))
    yield from attempt_finding(
        "GD-307",
        "note",
        sorted({name for pair in pairs for name in pair}),
        f"{{attempts}} with a near-duplicate, in {counted(len(pairs), 'pair')}",
    )
    for division in folds:
        parted = {
            name
            for left, right in pairs
            for name in (left, right)
            if division.fold.get(left, -1) != division.fold.get(right, -1)
            and left in division.fold.index
            and right in division.fold.index
        }
        yield from attempt_finding(
            "GD-403",
            "warning",
            sorted(parted),
            f"{{attempts}} of folds {division.name!r} with a near-duplicate in another fold",
        )
