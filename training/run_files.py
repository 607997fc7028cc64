"""Whether the files of a run are those that its record names, found without PyTorch."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handsight.training.card import names_weights
from handsight.training.run_folder import CARD, NEXT_WEIGHTS, WEIGHTS, is_card
from handsight.training.run_record import WEIGHTS_SHA256

_BLOCK_BYTES = 1 << 20
_LARGEST_WEIGHTS_BYTES = 1 << 30
"""More than those of any network that is built."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileCheck:
    """Whether the files of a run are those of its record."""

    weights: str
    """Name of the file that was looked at."""
    weights_fault: str | None
    """Why they are not the weights that the record names; None where they are, or an older record does not say."""
    weights_named: bool
    """Whether the record names its weights by their hash."""
    card: str
    """``current``, ``missing``, ``of other weights``, or ``not of handsight``."""


def check_files(folder: Path, record: Mapping[str, Any]) -> FileCheck:
    """Compare weights and card with the record.

    Raises:
        OSError: A file cannot be read.
    """
    expected = record.get(WEIGHTS_SHA256)
    # As when a run is loaded: a process that was killed late has left the weights at their other name.
    there = [path for path in (folder / WEIGHTS, folder / NEXT_WEIGHTS) if path.is_file()]
    faults = {path: _weights_fault(path, expected) for path in there} or {folder / WEIGHTS: "is missing"}
    path = next((one for one, fault in faults.items() if fault is None), next(iter(faults)))
    return FileCheck(
        weights=path.name,
        weights_fault=faults[path],
        weights_named=expected is not None,
        card=_card_state(folder, expected),
    )


def _weights_fault(path: Path, expected: str | None) -> str | None:
    size = path.stat().st_size
    if size > _LARGEST_WEIGHTS_BYTES:
        return f"has {size} bytes, expected at most {_LARGEST_WEIGHTS_BYTES}"
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK_BYTES):
            digest.update(block)
    found = digest.hexdigest()
    return None if expected in (None, found) else f"has the SHA-256 {found[:12]}…, expected {str(expected)[:12]}…"


def _card_state(folder: Path, weights_sha256: str | None) -> str:
    path = folder / CARD
    if not path.exists():
        return "missing"
    if not is_card(path):
        return "not of handsight"
    return "current" if names_weights(path, weights_sha256) else "of other weights"
