"""What ``evaluate --json`` printed, read back from a file that anybody may have written.

Every value that a report shows is looked at by type and range before anything is drawn, and all faults are said.
"""

from __future__ import annotations

import json
import reprlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

from handsight.datasets.errors import counted
from handsight.datasets.format.checks import number, or_null, text, truth, whole
from handsight.viz.errors import ReportError

LARGEST_BYTES = 256 << 20
_FAULTS_LISTED = 5
_MARKS = ("rows", "durations", "calibration", "causes")
"""Tables by which the file is known."""

_TEXT = text(4096)
_COUNT = whole(0, 2**53)
_SHARE = number(0, 1)
_FINITE = number(-1e30, 1e30)
_TALLY = "tally"
_PAIR = "pair"

_ROW = {"method": _TEXT, "objects": _TEXT}
_FORMS: dict[str, dict[str, Any]] = {
    "rows": {
        **_ROW,
        "trials": _COUNT,
        "aborted": _COUNT,
        "successes": _COUNT,
        "rate": _SHARE,
        "ci95": _PAIR,
        "step_ms": or_null(_FINITE),
        "mean_steps": or_null(_FINITE),
    },
    "comparisons": {**_ROW, "against": _TEXT, "pairs": _COUNT, "won": _COUNT, "lost": _COUNT, "p": _SHARE},
    "durations": {**_ROW, "moves": _COUNT, "trials": _COUNT, "successes": _COUNT, "limit": truth},
    "calibration": {
        **_ROW,
        "low": _SHARE,
        "high": _SHARE,
        "mean_score": _SHARE,
        "trials": _COUNT,
        "successes": _COUNT,
        "rate": _SHARE,
        "ci95": _PAIR,
    },
    "causes": {**_ROW, "trials": _COUNT, "failures": _COUNT, "unsure": _COUNT, "causes": _TALLY},
    "trials": {
        **_ROW,
        "number": _COUNT,
        "success": truth,
        "failure": _TEXT,
        "moves": _COUNT,
        "aborted": truth,
        "score": or_null(_SHARE),
    },
}
_FACTS = {
    "model": _TEXT,
    "weights_sha256": _TEXT,
    "gripper": _TEXT,
    "seed": whole(-(2**63), 2**64 - 1),
    "threshold": _SHARE,
    "level": or_null(truth),  # Older ones do not say.
}


def is_evaluation(values: object) -> bool:
    """Whether a JSON value is meant to be what ``evaluate --json`` prints."""
    return isinstance(values, dict) and all(isinstance(values.get(name), list) for name in _MARKS)


def read_json(path: Path) -> Any:
    """The value in a JSON file, without NaN.

    Raises:
        ReportError: It is too large, or no JSON.
        OSError: It cannot be read.
    """
    size = path.stat().st_size
    if size > LARGEST_BYTES:
        raise ReportError(f"{path} has {size} bytes, expected at most {LARGEST_BYTES}: leave it out")
    try:
        return json.loads(path.read_bytes().decode("utf-8"), parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise ReportError(f"{path} is no JSON ({error}): write it again, or leave it out") from error


def check_evaluation(path: Path, values: dict[str, Any]) -> None:
    """Refuse an evaluation with values that none can have.

    Raises:
        ReportError: All of them are counted, the first named.
    """
    faults = list(_faults(values))
    if faults:
        more = f"; and {len(faults) - _FAULTS_LISTED} more" if len(faults) > _FAULTS_LISTED else ""
        raise ReportError(
            f"{path} is damaged ({'; '.join(faults[:_FAULTS_LISTED])}{more}): evaluate again, or leave the file out"
        )


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


def _faults(values: dict[str, Any]) -> Iterator[str]:
    for name, check in _FACTS.items():
        if (expected := check(values.get(name))) is not None:
            yield f"{name} is {reprlib.repr(values.get(name))}, expected {expected}"
    for table, form in _FORMS.items():
        rows = values.get(table)
        if not isinstance(rows, list):
            yield f"{table} is {reprlib.repr(rows)}, expected a list"
            continue
        for at, row in enumerate(rows):
            if not isinstance(row, dict):
                yield f"{table}[{at}] is {reprlib.repr(row)}, expected an object"
                continue
            for key, check in form.items():
                if (expected := _expected(check, row.get(key))) is not None:
                    yield f"{table}[{at}].{key} is {reprlib.repr(row.get(key))}, expected {expected}"
    if not values["rows"]:
        yield f"rows has {counted(0, 'row')}, expected at least one"


def _expected(check: Any, value: object) -> str | None:
    if check == _PAIR:
        right = isinstance(value, list) and len(value) == 2 and all(_SHARE(end) is None for end in value)
        return None if right else "two numbers of 0 to 1"
    if check == _TALLY:
        right = isinstance(value, dict) and all(_COUNT(often) is None for often in value.values())
        return None if right else "counts by name"
    found: str | None = check(value)
    return found
