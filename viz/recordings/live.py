"""Servo runs in a viewer while they happen: the entities of a trace, streamed by a thread that nobody waits for.

Steps are handed over through a short queue. Where the thread falls behind, the oldest step that waits is dropped, and
the beginning of no trial while there is one; where the viewer stops answering, everything is, after one warning.
Servoing never notices either.
"""

from __future__ import annotations

import ctypes
import socket
import sys
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

import rerun as rr

from handsight.evaluation.trial import TrialRecording
from handsight.evaluation.watching import TrialStart
from handsight.servoing.loop import ServoStep
from handsight.servoing.methods.registry import METHODS
from handsight.viz.recordings.arm_drawing import DrawnArm
from handsight.viz.recordings.layouts import TraceRanges, trace_blueprint
from handsight.viz.recordings.trace_log import TraceLog

KIND: Final = "handsight_servo_live"
WAITING: Final = 16
"""Steps that wait for the thread at most: a whole run of most methods."""
DEFAULT_PORT: Final = 9876
"""Of Rerun's viewers."""
ANSWER_S: Final = 3.0
"""After so long without an answer a viewer counts as gone."""
CLOSE_S: Final = 5.0
"""So long the end of the trials waits for what is still to be shown."""
SWITCH_S: Final = 0.0005
"""So long the thread keeps Python to itself at most: servoing asks for it back after every call of PyTorch."""
STEP_MM, TURN_DEG, TIME_MS, SLOPE = 110.0, 55.0, 550.0, 0.5
"""Ranges of plots, which have to be chosen before anything is known."""
_HTTP2_SETTINGS: Final = b"\x04"
_HTTP2_HELLO: Final = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes(3) + _HTTP2_SETTINGS + bytes(5)
"""The preface of a connection, and empty settings (RFC 9113, sections 3.4 and 6.5)."""
_HTTP2_HEAD_BYTES: Final = 9
_Event = Callable[["_Showing"], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveFactory:
    """Opens a stream to a viewer in any process."""

    url: str
    """Of the viewer."""
    arm: DrawnArm | None = None
    warn: Callable[[str], None] | None = None
    """Told once, in a line, if the viewer stops answering; must survive pickling. None says nothing."""

    def __call__(self) -> LiveTrace:
        """Open it; whether the viewer is there is found out by the thread."""
        return LiveTrace(self.url, arm=self.arm, warn=self.warn)


@dataclass(slots=True)
class _Showing:
    """What the thread holds: the trial that is shown, and whether the viewer still answers."""

    url: str
    arm: DrawnArm | None
    stream: rr.RecordingStream | None = None
    log: TraceLog | None = None
    trial: int = 0
    """Which of the trials that were begun is shown, from 1: what comes of another one is not for its log."""

    def begin(self, start: TrialStart, trial: int) -> None:
        self.end_stream()
        _knock(self.url)
        self.trial = trial
        stream = rr.RecordingStream(KIND, send_properties=False)
        stream.set_log_time_enabled(False)
        x_m, y_m = start.overhead.pose_base_tool[:2, 3].tolist()
        method = METHODS[start.method]
        ranges = TraceRanges.of(
            start.station,
            start.overhead,
            last_step=method.max_steps,
            middle_m=(x_m, y_m),
            step_mm=STEP_MM,
            turn_deg=TURN_DEG,
            time_ms=TIME_MS,
            slope=SLOPE,
            input_px=64,
        )
        stream.connect_grpc(self.url, default_blueprint=trace_blueprint(ranges, following=True))
        stream.send_recording_name(f"{start.method} · trial {start.number}")
        self.stream, self.log = stream, TraceLog(stream, start, self.arm, live=True)
        self.log.begin()

    def end_stream(self) -> None:
        if self.stream is not None:
            self.stream.flush(timeout_sec=ANSWER_S)
            self.stream.disconnect()
        self.stream, self.log = None, None


def _knock(url: str) -> None:
    """Find out whether a viewer answers, before a stream waits for it.

    Rerun's stream takes everything while it connects, for as long as that takes. So the first words of HTTP/2 are said
    here, to which any server of gRPC has to answer with its settings.

    Raises:
        OSError: Nobody listens, or not to this, or nobody answers in time.
    """
    parts = urlsplit(url)
    with socket.create_connection((parts.hostname or "", parts.port or DEFAULT_PORT), timeout=ANSWER_S) as viewer:
        if parts.scheme != "rerun+http":
            return  # Whoever encrypts answers to nothing before.
        viewer.sendall(_HTTP2_HELLO)
        if viewer.recv(_HTTP2_HEAD_BYTES)[3:4] != _HTTP2_SETTINGS:
            raise ConnectionError("what listens there is no viewer")


class _Waiting:
    """A queue of bounded length, from whose front is dropped what it has no room for."""

    def __init__(self, most: int) -> None:
        self.dropped = 0
        self._most = most
        self._events: deque[tuple[bool, _Event | None]] = deque()
        self._changed = threading.Condition()

    def __len__(self) -> int:
        return len(self._events)

    def put(self, event: _Event | None, *, droppable: bool) -> None:
        """Append an event; None ends the queue. Never waits."""
        with self._changed:
            if len(self._events) >= self._most:
                # A step that can be dropped rather than the beginning of a trial, of which nothing would then be shown.
                at = next((at for at, (may, _) in enumerate(self._events) if may), 0)
                del self._events[at]
                self.dropped += 1
            self._events.append((droppable, event))
            self._changed.notify()

    def get(self) -> _Event | None:
        """The oldest event, once there is one."""
        with self._changed:
            self._changed.wait_for(lambda: self._events)
            return self._events.popleft()[1]


class LiveTrace:
    """A :class:`~handsight.evaluation.watching.TrialWatcher` that shows trials in a viewer."""

    def __init__(
        self,
        url: str,
        *,
        arm: DrawnArm | None = None,
        warn: Callable[[str], None] | None = None,
    ) -> None:
        """Begin to stream to the viewer at ``url``."""
        self._trial = 0
        self._warn = warn
        self._switch_s = sys.getswitchinterval()
        sys.setswitchinterval(min(SWITCH_S, self._switch_s))
        self._events = _Waiting(WAITING)
        self._gone = threading.Event()
        self._thread = threading.Thread(
            target=self._show, args=(_Showing(url, arm),), name="handsight-live", daemon=True
        )
        self._thread.start()

    @property
    def dropped(self) -> int:
        """How much was not shown because too much waited."""
        return self._events.dropped

    @property
    def gone(self) -> bool:
        """Whether the viewer has stopped answering."""
        return self._gone.is_set()

    def begin(self, start: TrialStart) -> None:
        """A trial begins."""
        self._trial += 1
        trial = self._trial
        self._put(lambda showing: showing.begin(start, trial))

    def step(self, step: ServoStep) -> None:
        """The loop has looked and chosen."""
        trial = self._trial

        def show(showing: _Showing) -> None:
            if showing.log is not None and showing.trial == trial:
                showing.log.step(step)

        self._put(show, droppable=True)

    def end(self, recording: TrialRecording | None) -> None:
        """The grasp was executed."""
        trial = self._trial

        def show(showing: _Showing) -> None:
            if showing.log is None or showing.trial != trial:
                return
            if recording is not None:
                showing.log.end(recording)
            showing.end_stream()

        self._put(show)

    def close(self) -> None:
        """Wait a little for what is still to be shown, and leave the rest."""
        self._put(None)
        self._thread.join(timeout=CLOSE_S)
        sys.setswitchinterval(self._switch_s)

    def _put(self, event: _Event | None, *, droppable: bool = False) -> None:
        if not self._gone.is_set():
            self._events.put(event, droppable=droppable)

    def _show(self, showing: _Showing) -> None:
        """The thread: show one event after another, and after each ask whether the viewer has it."""
        while (event := self._events.get()) is not None:
            try:
                event(showing)
                if showing.stream is not None:
                    showing.stream.flush(timeout_sec=ANSWER_S)
            except Exception as error:  # A viewer must not end a servo run, whatever is wrong with it.
                self._leave(showing, error)
                return

    def _leave(self, showing: _Showing, error: Exception) -> None:
        self._gone.set()
        _abandon(showing)
        if self._warn is not None:
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            self._warn(f"the viewer stopped answering, servoing goes on without it ({reason})")


def _abandon(showing: _Showing) -> None:
    """Leave a stream whose viewer does not answer as it is: to take it apart would be to wait for the viewer.

    Rerun waits for all of its streams at the end of the process too, and is told not to. What is saved to files is
    closed by whoever writes it.
    """
    rr.unregister_shutdown()
    if showing.stream is not None:
        # Never freed: its destructor waits as well, even while the interpreter is taken apart.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(showing.stream))
