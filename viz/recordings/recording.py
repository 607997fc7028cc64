"""Opening and closing Rerun files so that they are whole, and equal for equal content."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from handsight.datasets.atomic import atomic_file
from handsight.datasets.writable import file_fault
from handsight.viz.errors import RecordingError

_SWITCH = "RERUN"


def check_recording_path(path: Path) -> None:
    """Refuse a place where no recording can be written, before long work is done for it.

    Raises:
        RecordingError: ``path`` is a folder, lies in none, or the folder takes no new files.
    """
    if (fault := file_fault(path)) is not None:
        raise RecordingError(f"cannot write a recording to {str(path)!r}: {fault}; choose another file")


@contextmanager
def write_recording(
    path: Path, *, kind: str, name: str, blueprint: rrb.Blueprint | None, title: str | None = None
) -> Iterator[rr.RecordingStream]:
    """A stream into ``path``, which appears there only when the block ends without an error.

    Recordings carry no wall-clock timeline, start time or host name: equal content gives equal tables.

    Args:
        path: The ``.rrd`` file; an existing one is replaced.
        kind: Application id. The viewer remembers one layout per kind.
        name: Recording id, and title unless another is given.
        blueprint: The layout, stored in the file; None where whoever shows the recording has one.
        title: What people see of it in lists.

    Raises:
        RecordingError: As for :func:`check_recording_path`.
    """
    check_recording_path(path)
    with atomic_file(path) as unfinished:
        with _switched_on():
            recording = rr.RecordingStream(kind, recording_id=name, send_properties=False)
        try:
            recording.set_log_time_enabled(False)
            recording.set_log_tick_enabled(False)
            recording.save(unfinished, default_blueprint=blueprint)
            recording.send_recording_name(name if title is None else title)
            yield recording
        finally:
            recording.disconnect()


@contextmanager
def _switched_on() -> Iterator[None]:
    """Streams that are opened now write, although ``RERUN=0`` in the environment says that logging is off.

    Whoever asks for a file wants one; a stream that is off would leave none, and not say so.
    """
    before = os.environ.get(_SWITCH)
    os.environ[_SWITCH] = "on"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SWITCH]
        else:
            os.environ[_SWITCH] = before


def paused_layout(content: rrb.Container, *, timeline: str, fps: float, following: bool = False) -> rrb.Blueprint:
    """The layout of every recording: the content, paused on its timeline, and nothing else open.

    One that is still being made is followed instead.
    """
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline=timeline, play_state="following" if following else "paused", fps=fps, state="collapsed"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_layout=False,
        auto_views=False,
    )
