"""What a rig writes beside its data: the operator log, raw readings, and the heartbeat that a watchdog looks at."""

from __future__ import annotations

import getpass
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from handsight.collection.errors import RigPausedError
from handsight.datasets.atomic import write_text


def append_line(path: Path, values: dict[str, Any]) -> None:
    """Append one line of JSON, on disk when this returns.

    Raises:
        RigPausedError: The disk is full, for instance: a rig that cannot say what it does stands still.
    """
    with _pausing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(values, ensure_ascii=False) + "\n")
            file.flush()
            os.fsync(file.fileno())


@contextmanager
def _pausing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RigPausedError(
            f"{path} cannot be written ({error.strerror or error}): make room on its disk, then go on with --resume"
        ) from error


class OperatorLog:
    """Who did or changed what, and when; people and the rig itself."""

    def __init__(self, path: Path, *, who: str | None = None) -> None:
        """Lines are appended to ``path``; ``who`` is the user of this process unless given."""
        self.path = path
        self._who = who or _user()

    def note(self, what: str, **values: Any) -> None:
        """Add a line; see :func:`append_line` for errors."""
        append_line(self.path, {"at": now(), "who": self._who, "what": what, **values})


class Heartbeat:
    """A small file that is replaced whenever something happens; one that grows old means that nothing does."""

    def __init__(self, path: Path) -> None:
        """Nothing is written yet."""
        self.path = path

    def beat(self, state: str, **values: Any) -> None:
        """Replace the file; see :func:`append_line` for errors."""
        said = {"at": now(), "unix_s": time.time(), "pid": os.getpid(), "state": state, **values}
        with _pausing(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self.path, json.dumps(said) + "\n")


def now() -> str:
    """The time, in UTC and to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return str(os.getuid())
