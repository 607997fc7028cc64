"""A file in which an evaluation writes each trial as it ends, so that an interrupted one goes on where it was.

The first line says what is evaluated, every other one is a trial, as JSON. Trials of other settings or other weights
would be compared as if they were the same, so that a journal refuses them. An aborted trial stays aborted: to perform
it again would be to choose results.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Final

from handsight.evaluation.errors import JournalError
from handsight.evaluation.trial import Trial

FORMAT: Final = "handsight_evaluation"
VERSION: Final = 1
_TYPES: Final[dict[str, tuple[type, ...]]] = {
    "int": (int,),
    "bool": (bool,),
    "str": (str,),
    "float": (int, float, type(None)),
    "float | None": (int, float, type(None)),
    "bool | None": (bool, type(None)),
    "tuple[tuple[float, ...], ...]": (list,),
}


class Journal:
    """An open journal, held by this process alone."""

    def __init__(self, descriptor: int, known: dict[str, list[Trial]]) -> None:
        self._descriptor = descriptor
        self._known = known

    def known(self, objects: str) -> list[Trial]:
        """The trials on an object set that it held when it was opened."""
        return self._known.get(objects, [])

    def append(self, objects: str, trial: Trial) -> None:
        """Write one trial; it survives whatever happens to this process afterwards."""
        _write(self._descriptor, {"objects": objects, **trial_to_json(trial)})


@contextmanager
def open_journal(path: Path, settings: Mapping[str, Any]) -> Iterator[Journal]:
    """Begin a journal, or go on with the one that is there.

    Args:
        path: The file; its folder exists.
        settings: Everything that decides the trials, as JSON values; how many there are is not among them.

    Raises:
        JournalError: Something else is there, its settings are others, lines are damaged, or another process writes it.
        OSError: The file cannot be opened or written.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise JournalError(f"another evaluation is writing {path}: wait for it, or choose another file") from error
        yield Journal(descriptor, _take_up(path, descriptor, json.loads(json.dumps(settings))))
    finally:
        os.close(descriptor)


def trial_to_json(trial: Trial) -> dict[str, Any]:
    """A trial as JSON values; what is not a number becomes null."""
    return {
        name: None if isinstance(value, float) and math.isnan(value) else value for name, value in asdict(trial).items()
    }


def _take_up(path: Path, descriptor: int, settings: dict[str, Any]) -> dict[str, list[Trial]]:
    """Read the journal, cut off the line that an interruption left without its end, or write the first line."""
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    begun = f'{{"{FORMAT}"'.encode()
    if not whole and (content.startswith(begun) or begun.startswith(content)):
        os.ftruncate(descriptor, 0)
        _write(descriptor, {FORMAT: VERSION, "settings": settings})
        return {}
    first, *others = whole.decode(errors="replace").splitlines() or [""]
    _check_settings(path, first, settings)
    known = _trials(path, others)
    os.ftruncate(descriptor, len(whole))
    return known


def _check_settings(path: Path, first: str, settings: dict[str, Any]) -> None:
    header = _json(first)
    recorded = header.get("settings") if header is not None else None
    if header is None or FORMAT not in header or not isinstance(recorded, dict):
        raise JournalError(f"{path} is no journal of an evaluation: choose another file")
    if header[FORMAT] != VERSION:
        raise JournalError(f"{path} has version {header[FORMAT]!r}, expected {VERSION}: choose another file")
    # Also what it had and we do not: what is usual goes without saying.
    names = dict.fromkeys([*settings, *recorded])
    faults = [fault for name in names for fault in _differences(name, settings.get(name), recorded.get(name))]
    if faults:
        raise JournalError(
            f"{path} holds trials of another evaluation: {'; '.join(faults)}: give the same options, or choose "
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


def _trials(path: Path, lines: list[str]) -> dict[str, list[Trial]]:
    known: dict[str, list[Trial]] = {}
    damaged = []
    for number, line in enumerate(lines, start=2):
        record = _json(line)
        objects = record.pop("objects", None) if record is not None else None
        trial = _trial_from_json(record) if record is not None and isinstance(objects, str) else None
        if trial is None:
            damaged.append(str(number))
        else:
            known.setdefault(str(objects), []).append(trial)
    if damaged:
        shown = ", ".join(damaged[:5]) + (", …" if len(damaged) > 5 else "")
        raise JournalError(f"{path} is damaged in line {shown}, expected a trial in each: choose another file")
    return known


def _trial_from_json(record: dict[str, Any]) -> Trial | None:
    """The trial that a line holds; None where it holds none."""
    kinds = {field.name: str(field.type) for field in fields(Trial)}
    record = {"touched_by": "", "pushed_m": None, "steps": [], **record}  # Older journals have none.
    if record.keys() != kinds.keys() or any(type(record[name]) not in _TYPES[kinds[name]] for name in kinds):
        return None
    steps = _steps_from_json(record["steps"])
    if steps is None:
        return None
    missing = {name: math.nan for name, kind in kinds.items() if kind == "float" and record[name] is None}
    return Trial(**{**record, **missing, "steps": steps})


def _steps_from_json(values: list[Any]) -> tuple[tuple[float, ...], ...] | None:
    if not all(isinstance(step, list) and all(type(value) in (int, float) for value in step) for step in values):
        return None
    return tuple(tuple(map(float, step)) for step in values)


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
