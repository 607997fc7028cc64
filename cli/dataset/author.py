"""Who decides, where ``--author`` does not say so."""

from __future__ import annotations

import getpass
import os


def author_named(given: str) -> str:
    """The author given, or the user's name, or in a container that knows no name the number of the user."""
    if given:
        return given
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # The latter from Python 3.13 on.
        return f"uid {os.getuid()}"
