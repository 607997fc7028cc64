"""What goes wrong with the machine that collects, and not with the rig."""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Callable

from tests.support.watched_rig import WatchedStation


def _kill(station: WatchedStation, name: str) -> None:
    pid = getattr(station, name).child.pid
    if pid is not None:
        os.kill(pid, signal.SIGKILL)


def _fill_disk(station: WatchedStation) -> None:
    """No file of this process grows any more; Python ignores the signal, so writing fails as on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


def let_files_grow() -> None:
    """The disk has room again."""
    most = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))


LOCAL: dict[str, Callable[[WatchedStation], None]] = {
    "disk-full": _fill_disk,
    "kill-arm": lambda station: _kill(station, "arm"),
    "kill-camera": lambda station: _kill(station, "camera"),
}
