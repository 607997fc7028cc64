"""``run.json``: what a run says of itself, and the check of all of it before anything is built from it.

The file may have been edited, damaged or copied from elsewhere. Every value is looked at by type and range, and all
that is wrong is reported at once. A seal over the content finds changes that are possible values too, such as another
crop, at which the network's scores would mean nothing.
"""

from __future__ import annotations

import hashlib
import json
import re
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from handsight.datasets.errors import counted
from handsight.datasets.format.checks import number, one_of, or_null, text, truth, whole
from handsight.servoing.errors import ServoSettingsError
from handsight.training.errors import CheckpointError, NetworkSettingsError

if TYPE_CHECKING:
    # PyTorch takes seconds, and a list of runs needs none.
    from handsight.servoing.homography import InputGrid
    from handsight.training.gqn import GqnConfig

RUN_VERSION = 2
"""Version 2 has a list of origins, where version 1 had one."""
TWINS_TOGETHER = "twins_together"
"""Whether attempts at one grasp were held out together: in records without it, only inputs of one attempt were."""
WEIGHTS_SHA256 = "weights_sha256"
RECORD_SHA256 = "record_sha256"
"""Of everything in the record but the keys that end in ``_sha256``, as JSON with sorted keys."""

LARGEST_RECORD_BYTES = 16 << 20
"""A record has a few hundred bytes for each epoch."""
MOST_ORIGINS = 1000
CHANNEL_NAMES = ("rgbd", "rgb", "depth")
PRECISION_NAMES = ("float32", "bfloat16", "auto")
"""Of modules that import PyTorch, with a test that they agree."""
_FAULTS_LISTED = 8


@dataclass(frozen=True, slots=True)
class _Optional:
    """A key that records of older versions lack."""

    form: Any


def sealed(record: dict[str, Any]) -> dict[str, Any]:
    """The record with the hash of its content."""
    return {**record, RECORD_SHA256: _seal(record)}


def read_values(path: Path) -> dict[str, Any]:
    """The record of a run, without PyTorch: its values are such as a run can have, and those that it was sealed with.

    Whether a network can be built of them, :func:`read_record` tells, which matters where a record has no seal.

    Raises:
        CheckpointError: It is no JSON, or some values are none that a run can have; all of them are named. Or it was
            written by a newer handsight, or changed since it was written.
        OSError: It cannot be read.
    """
    record = _formed(path)
    if faults := _disagreements(record):
        raise damaged(path, faults)
    return record


def read_record(path: Path) -> tuple[dict[str, Any], GqnConfig, InputGrid]:
    """The record of a run, with the network and the grid that it describes.

    Raises:
        CheckpointError: As for :func:`read_values`, or the values describe no network.
        OSError: It cannot be read.
    """
    from handsight.servoing.homography import InputGrid  # PyTorch; see above
    from handsight.training.gqn import GqnConfig

    record = _formed(path)
    try:
        config, grid = GqnConfig.from_json(record["settings"]["network"]), InputGrid(**record["grid"])
    except (NetworkSettingsError, ServoSettingsError) as error:
        raise damaged(path, [str(error)]) from error
    if faults := _disagreements(record):
        raise damaged(path, faults)
    return record, config, grid


def origins_of(record: dict[str, Any]) -> list[dict[str, Any]]:
    """What a record that was read names as the data, of every version."""
    return record["origins"] if "origins" in record else [record["origin"]]


def damaged(path: Path, faults: list[str]) -> CheckpointError:
    """The error for a file of a run of which something is wrong."""
    more = f"; and {len(faults) - _FAULTS_LISTED} more" if len(faults) > _FAULTS_LISTED else ""
    return CheckpointError(
        f"{path} is damaged ({'; '.join(faults[:_FAULTS_LISTED])}{more}): train again, or restore the run from a copy"
    )


def _formed(path: Path) -> dict[str, Any]:
    """The record, once every value is of its type and in its range."""
    record = _parse(path)
    if isinstance(record, dict):
        _check_version(path, record.get("run_version"))
    faults = [*_faults(record, _RECORD, ""), *_origin_faults(record)]
    if faults:
        raise damaged(path, faults)
    formed: dict[str, Any] = record
    return formed


def _disagreements(record: dict[str, Any]) -> list[str]:
    """Where values that are fine one by one are not those of one run."""
    faults = []
    size_px, expected_px = record["grid"]["size_px"], record["settings"]["network"]["size_px"]
    if size_px != expected_px:
        faults.append(f"grid.size_px is {size_px}, expected {expected_px} as settings.network.size_px is")
    if record.get(RECORD_SHA256, seal := _seal(record)) != seal:
        faults.append("its values are not those that were written with it")
    return faults


def _parse(path: Path) -> Any:
    size = path.stat().st_size
    if size > LARGEST_RECORD_BYTES:
        raise damaged(path, [f"it has {size} bytes, expected at most {LARGEST_RECORD_BYTES}"])
    try:
        return json.loads(path.read_bytes().decode("utf-8"), parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise damaged(path, [f"it is no JSON: {error}"]) from error


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


def _seal(record: dict[str, Any]) -> str:
    content = {name: value for name, value in record.items() if not name.endswith("_sha256")}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _check_version(path: Path, version: Any) -> None:
    if isinstance(version, int) and not isinstance(version, bool) and version > RUN_VERSION:
        raise CheckpointError(
            f"{path} was written by a newer handsight (run version {reprlib.repr(version)}, this one reads up to "
            f"{RUN_VERSION}): upgrade handsight"
        )


def _faults(value: Any, form: Any, where: str) -> Iterator[str]:
    """What of ``value`` is not in the form: a check, a list of one form, or forms by key."""
    name = where or "the record"
    if isinstance(form, dict):
        if not isinstance(value, dict):
            yield f"{name} is {reprlib.repr(value)}, expected an object"
            return
        for key, part in form.items():
            inner = f"{where}.{key}" if where else key
            if key in value:
                yield from _faults(value[key], part.form if isinstance(part, _Optional) else part, inner)
            elif not isinstance(part, _Optional):
                yield f"{inner} is missing"
        if re.sub(r"\[\d+\]", "[]", where) in _CLOSED:
            yield from (f"{where}.{reprlib.repr(key)} is no setting that is known" for key in value if key not in form)
    elif isinstance(form, list):
        if not isinstance(value, list):
            yield f"{name} is {reprlib.repr(value)}, expected a list"
            return
        for at, entry in enumerate(value):
            yield from _faults(entry, form[0], f"{where}[{at}]")
    elif (expected := form(value)) is not None:
        yield f"{name} is {reprlib.repr(value)}, expected {expected}"


def _origin_faults(record: Any) -> Iterator[str]:
    """What is wrong with where the data are named; their values are looked at elsewhere."""
    if not isinstance(record, dict):
        return
    if record.get("run_version") == 1:
        expected, other = "origin", "origins"
    else:
        expected, other = "origins", "origin"
    if expected not in record:
        yield f"{expected} is missing"
    if other in record:
        yield f"there is {other!r} in run version {reprlib.repr(record.get('run_version'))}, expected {expected!r}"
    origins = record.get("origins")
    if isinstance(origins, list) and not 1 <= len(origins) <= MOST_ORIGINS:
        yield f"origins has {counted(len(origins), 'entry', 'entries')}, expected 1 to {MOST_ORIGINS}"


def _sha256(value: object) -> str | None:
    return None if isinstance(value, str) and re.fullmatch("[0-9a-f]{64}", value) else "64 hexadecimal digits"


_TEXT = text(4096)
_COUNT = whole(0, 2**53)
_SHARE = number(0, 1)
_SIZE = whole(1, 2**31)
_SPAN_M = number(1e-3, 100)
_FINITE = number(-1e30, 1e30)

_CLOSED = ("origin", "origins[]", "grid", "settings.network")
"""Where a key that is not known would have a meaning that is missed."""

# Ranges of sizes are those of the types that are built from them; here it is enough that they are numbers.
_ORIGIN = {
    "dataset": _TEXT,
    "ref": _TEXT,
    "snapshot": _TEXT,
    "digest": _TEXT,
    "view": one_of("overhead", "pregrasp"),
    "attempts": _COUNT,
}
_RECORD = {
    "run_version": whole(1, RUN_VERSION),
    "handsight": _Optional(_TEXT),
    "created": _Optional(_TEXT),
    "origin": _Optional(_ORIGIN),
    "origins": _Optional([_ORIGIN]),
    "grid": {"crop_px": _SIZE, "size_px": _SIZE, "span_m": _Optional(_SPAN_M)},
    "settings": {
        "network": {
            "channels": one_of(*CHANNEL_NAMES),
            "widths": [_SIZE],
            "kernels": [_SIZE],
            "dense": [_SIZE],
            "size_px": _SIZE,
            "padded": _Optional(truth),
        },
        "epochs": _Optional(whole(1, 2**31)),
        "least_epochs": _Optional(whole(1, 2**31)),
        "patience": _Optional(whole(1, 2**31)),
        "batch": _Optional(whole(2, 2**31)),
        "learning_rate": _Optional(_SHARE),
        "warmup_steps": _Optional(whole(0, 2**31)),
        "average": _Optional(_SHARE),
        "weight_decay": _Optional(_SHARE),
        "mixup": _Optional(_FINITE),
        "balance": _Optional(truth),
        "holdout": _Optional(_SHARE),
        "jitter": _Optional(
            {
                "brightness": _Optional(_FINITE),
                "colour_noise": _Optional(_FINITE),
                "height_noise_m": _Optional(_FINITE),
                "turn_rad": _Optional(_FINITE),
                "shift": _Optional(_FINITE),
                "flips": _Optional(truth),
            }
        ),
        "precision": _Optional(one_of(*PRECISION_NAMES)),
        "seed": _Optional(whole(-(2**63), 2**64 - 1)),
    },
    TWINS_TOGETHER: _Optional(truth),
    "selection": _Optional(
        {
            "where": _TEXT,
            "filter": _TEXT,
            "folds": _TEXT,
            "fold": _COUNT,
            "size": or_null(_COUNT),
        }
    ),
    "parameters": _Optional(_COUNT),
    "history": [
        {
            "number": _COUNT,
            "train_loss": _FINITE,
            "held_out": {
                "attempts": _COUNT,
                "accuracy": or_null(_SHARE),
                "auc": or_null(_SHARE),
                "loss": or_null(_FINITE),
            },
        }
    ],
    "kept_epoch": _Optional(or_null(_COUNT)),
    WEIGHTS_SHA256: _Optional(_sha256),
    RECORD_SHA256: _Optional(_sha256),
}
