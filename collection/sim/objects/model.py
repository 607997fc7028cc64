"""An object that the simulator can load."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectModel:
    """A rigid object that PyBullet can load."""

    object_id: str
    """Stable name, ``set/name``; what datasets record."""
    urdf: Path
    scale: float
