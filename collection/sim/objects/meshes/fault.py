"""Why one file cannot become an object, and how its name is shown."""

from __future__ import annotations

from pathlib import Path

MAX_TRIANGLES = 100_000
"""Pictures are drawn by software: more triangles than this per object would take most of an attempt's time."""


class MeshFault(Exception):  # noqa: N818 -- a finding about one file, collected into a MeshImportError, never raised to users
    """Why one file cannot be used."""


def shown(text: str | Path) -> str:
    """Text from a file or a file name for a terminal: whatever cannot be printed, escape codes included, is escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(text))
