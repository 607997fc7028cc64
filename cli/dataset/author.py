"""Who decides, where ``--author`` does not say so."""

from __future__ import annotations

import getpass


def author_named(given: str) -> str:
    """The author given, or the user's name."""
    return given or getpass.getuser()
