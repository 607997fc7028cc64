"""A file in which an evaluation writes each trial as it ends, so that an interrupted one goes on where it was.

The first line says what is evaluated, every other one is a trial, as JSON; or a table that was cleared, or whatever
else a :class:`JournalKind` says. Trials of other settings or other weights would be compared as if they were the same,
so that a journal refuses them. An aborted trial stays aborted: to perform it again would be to choose results.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

from handsight.evaluation.errors import JournalError

VERSION: Final = 1
Record = TypeVar("Record")


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalKind(Generic[Record]):
    """What the lines of a journal are."""

    name: str
    """What writes it, such as "evaluation"; with an article, "an evaluation"."""
    with_article: str
    noun: str
    """What a line holds, such as "trial"."""
    to_json: Callable[[Record], dict[str, Any]]
    from_json: Callable[[dict[str, Any]], Record | None]
    """The record that a line holds; None where it holds none."""

    @property
    def format(self) -> str:
        """First word of the file."""
        return f"handsight_{self.name}"


class Journal(Generic[Record]):
    """An open journal, held by this process alone."""

    def __init__(self, descriptor: int, kind: JournalKind[Record], known: dict[str, list[Record]]) -> None:
        self._descriptor = descriptor
        self._kind = kind
        self._known = known

    def known(self, objects: str) -> list[Record]:
        """The records of an object set that it held when it was opened."""
        return self._known.get(objects, [])

    def append(self, objects: str, record: Record) -> None:
        """Write one record; it survives whatever happens to this process afterwards."""
        _write(self._descriptor, {"objects": objects, **self._kind.to_json(record)})


@contextmanager
def open_journal(path: Path, kind: JournalKind[Record], settings: Mapping[str, Any]) -> Iterator[Journal[Record]]:
    """Begin a journal, or go on with the one that is there.

    Args:
        path: The file; its folder exists.
        kind: What its lines are.
        settings: Everything that decides the records, as JSON values; how many there are is not among them.

    Raises:
        JournalError: Something else is there, its settings are others, lines are damaged, or another process writes it.
        OSError: The file cannot be opened or written.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise JournalError(f"another {kind.name} is writing {path}: wait for it, or choose another file") from error
        yield Journal(descriptor, kind, _take_up(path, descriptor, kind, json.loads(json.dumps(settings))))
    finally:
        os.close(descriptor)


@contextmanager
def perhaps_journal(
    path: Path | None, kind: JournalKind[Record], settings: Mapping[str, Any]
) -> Iterator[Journal[Record] | None]:
    """As :func:`open_journal`; None where none is kept."""
    if path is None:
        yield None
        return
    with open_journal(path, kind, settings) as journal:
        yield journal


def _take_up(
    path: Path, descriptor: int, kind: JournalKind[Record], settings: dict[str, Any]
) -> dict[str, list[Record]]:
    """Read the journal, cut off the line that an interruption left without its end, or write the first line."""
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    begun = f'{{"{kind.format}"'.encode()
    if not whole and (content.startswith(begun) or begun.startswith(content)):
        os.ftruncate(descriptor, 0)
        _write(descriptor, {kind.format: VERSION, "settings": settings})
        return {}
    first, *others = whole.decode(errors="replace").splitlines() or [""]
    _check_settings(path, first, kind, settings)
    known = _records(path, others, kind)
    os.ftruncate(descriptor, len(whole))
    return known


def _check_settings(path: Path, first: str, kind: JournalKind[Record], settings: dict[str, Any]) -> None:
    header = _json(first)
    recorded = header.get("settings") if header is not None else None
    if header is None or kind.format not in header or not isinstance(recorded, dict):
        raise JournalError(f"{path} is no journal of {kind.with_article}: choose another file")
    if header[kind.format] != VERSION:
        raise JournalError(f"{path} has version {header[kind.format]!r}, expected {VERSION}: choose another file")
    # Also what it had and we do not: what is usual goes without saying.
    names = dict.fromkeys([*settings, *recorded])
    faults = [fault for name in names for fault in _differences(name, settings.get(name), recorded.get(name))]
    if faults:
        raise JournalError(
            f"{path} holds {kind.noun}s of another {kind.name}: {'; '.join(faults)}: give the same options, or choose "
            "another file"
        )


def _differences(name: str, ours: Any, theirs: Any) -> Iterator[str]:
    """What differs, named as precisely as the two can be compared."""
    if ours == theirs:
        return
    if not isinstance(ours, dict) or not isinstance(theirs, dict):
        yield f"{name} is {_shown(ours)}, and was {_shown(theirs)}"
    elif ours.keys() != theirs.keys():
        yield f"{name} is {', '.join(ours)}, and was {', '.join(theirs)}"
    else:
        yield from (f for key in ours for f in _differences(f"{name} {key}", ours[key], theirs[key]))


def _shown(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 40 else f"{text[:12]}…"


def _records(path: Path, lines: list[str], kind: JournalKind[Record]) -> dict[str, list[Record]]:
    known: dict[str, list[Record]] = {}
    damaged = []
    for number, line in enumerate(lines, start=2):
        values = _json(line)
        objects = values.pop("objects", None) if values is not None else None
        record = kind.from_json(values) if values is not None and isinstance(objects, str) else None
        if record is None:
            damaged.append(str(number))
        else:
            known.setdefault(str(objects), []).append(record)
    if damaged:
        shown = ", ".join(damaged[:5]) + (", …" if len(damaged) > 5 else "")
        raise JournalError(f"{path} is damaged in line {shown}, expected a {kind.noun} in each: choose another file")
    return known


def _json(line: str) -> dict[str, Any] | None:
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def _write(descriptor: int, value: dict[str, Any]) -> None:
    """One line, in one call."""
    line = (json.dumps(value) + "\n").encode()
    while line:
        line = line[os.write(descriptor, line) :]
