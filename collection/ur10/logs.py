"""What a rig writes beside its data: the operator log, raw readings, and the heartbeat that a watchdog looks at."""

from __future__ import annotations

import getpass
import json
import os
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from handsight.datasets.atomic import write_text


def append_line(path: Path, values: dict[str, Any]) -> None:
    """Append one line of JSON, on disk when this returns."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(values, ensure_ascii=False) + "\n")
        file.flush()
        os.fsync(file.fileno())


class OperatorLog:
    """Who did or changed what, and when; people and the rig itself."""

    def __init__(self, path: Path, *, who: str | None = None) -> None:
        """Lines are appended to ``path``; ``who`` is the user of this process unless given."""
        self.path = path
        self._who = who or _user()

    def note(self, what: str, **values: Any) -> None:
        """Add a line."""
        append_line(self.path, {"at": now(), "who": self._who, "what": what, **values})


class Heartbeat:
    """A small file that is replaced whenever something happens; one that grows old means that nothing does."""

    def __init__(self, path: Path) -> None:
        """Nothing is written yet."""
        self.path = path

    def beat(self, state: str, **values: Any) -> None:
        """Replace the file."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        said = {"at": now(), "unix_s": time.time(), "pid": os.getpid(), "state": state, **values}
        write_text(self.path, json.dumps(said) + "\n")


def now() -> str:
    """The time, in UTC and to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return str(os.getuid())
