"""Files of recordings, checked before a viewer opens them: it would show an empty window and say nothing."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import rerun as rr
from rerun.chunk import RrdReader

from handsight.datasets.errors import pasteable
from handsight.viz.errors import RecordingError

_SIGN, _OLDER_SIGNS = b"RRF2", (b"RRF0", b"RRF1")
_HEAD_BYTES = 8
AGAIN: Final = "record it again with this handsight"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedFile:
    """What a file holds."""

    kind: str
    """Application id."""
    name: str
    """Recording id."""


def read_recorded_file(path: Path, *, kind: str, what: str) -> RecordedFile:
    """Look into a recording without loading what it shows.

    Args:
        path: The file.
        kind: Application id that it should have.
        what: What such a recording is called, for people.

    Raises:
        RecordingError: There is no such file, it is no recording or is cut off, was written by a newer or a very old
            version of Rerun, or shows something else.
    """
    _check_head(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # Rerun warns of a file without its end, and then reads on.
            found = [
                RecordedFile(kind=one.application_id, name=one.recording_id)
                for one in RrdReader(str(path)).recordings()
            ]
    except Warning as warning:
        raise RecordingError(f"{path} was cut off before its end; {AGAIN}") from warning
    except (OSError, RuntimeError, ValueError) as error:
        raise RecordingError(f"{path} is damaged ({_first_line(error)}); {AGAIN}") from error
    if not found:
        raise RecordingError(f"{path} holds no recording, or was cut off before its end; {AGAIN}")
    if found[0].kind != kind:
        raise RecordingError(
            f"{path} shows {found[0].kind!r}, expected {what} ({kind!r}); open it with {pasteable('rerun', path)}"
        )
    return found[0]


def _check_head(path: Path) -> None:
    if not path.is_file():
        raise RecordingError(f"there is no recording at {str(path)!r}, expected an .rrd file")
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if head[:4] in _OLDER_SIGNS:
        raise RecordingError(f"{path} was written by a Rerun before 0.23, expected {_ours()}; {AGAIN}")
    if head[:4] != _SIGN or len(head) < _HEAD_BYTES:
        raise RecordingError(f"{path} is no recording, expected an .rrd file as 'handsight servo' writes it")
    version = (head[4], head[5])
    if version > _version():
        raise RecordingError(
            f"{path} was written by Rerun {version[0]}.{version[1]}, expected {_ours()} or older; {AGAIN}, or open it "
            "with the rerun that wrote it"
        )


def _version() -> tuple[int, int]:
    major, minor, *_ = rr.__version__.split(".")
    return int(major), int(minor)


def _ours() -> str:
    return "Rerun {}.{}".format(*_version())


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
