"""Whether there is a screen, asked before anything slow is imported."""

from __future__ import annotations

import os
import sys

from handsight.viz.errors import ViewerError


def check_display(remedy: str = "pass --web to look with a web browser") -> None:
    """Refuse to open a window where there is no screen.

    Args:
        remedy: What to do then.

    Raises:
        ViewerError: There is none.
    """
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ViewerError(
            f"there is no display for the viewer's window (neither DISPLAY nor WAYLAND_DISPLAY is set): {remedy}"
        )
