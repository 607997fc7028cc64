"""The program that makes a trace's messages for a viewer while the run goes on: ``python -m`` it, and send events.

It is a process of its own, so that the run is not held up by what it takes to make pictures: two threads of one process
would compute in turns. It writes a byte once it takes events. Whatever goes wrong with the viewer is the last line on
standard error, and the end.
"""

from __future__ import annotations

import os
import socket
import sys
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

import rerun as rr

from handsight.servoing.methods.registry import METHODS
from handsight.viz.recordings.arm_drawing import DrawnArm
from handsight.viz.recordings.layouts import TraceRanges, trace_blueprint
from handsight.viz.recordings.live_wire import Begun, Ended, Event, Watch, first_line, receive
from handsight.viz.recordings.trace_log import TraceLog

KIND: Final = "handsight_servo_live"
DEFAULT_PORT: Final = 9876
"""Of Rerun's viewers."""
ANSWER_S: Final = 3.0
"""After so long without an answer a viewer counts as gone."""
NICENESS: Final = 5
"""Where processors are scarce, servoing comes first."""
STEP_MM, TURN_DEG, TIME_MS, SLOPE = 110.0, 55.0, 550.0, 0.5
"""Ranges of plots, which have to be chosen before anything is known."""
_HTTP2_SETTINGS: Final = b"\x04"
_HTTP2_HELLO: Final = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes(3) + _HTTP2_SETTINGS + bytes(5)
"""The preface of a connection, and empty settings (RFC 9113, sections 3.4 and 6.5)."""
_HTTP2_HEAD_BYTES: Final = 9


@dataclass(slots=True)
class Showing:
    """The trial that is shown."""

    url: str
    arm: DrawnArm | None
    stream: rr.RecordingStream | None = None
    log: TraceLog | None = None
    trial: int = 0

    def show(self, event: Event) -> None:
        """Stream what an event has, and wait until the viewer has taken it.

        Raises:
            Exception: Of whatever kind: the viewer did not.
        """
        if isinstance(event, Begun):
            self._begin(event)
        elif self.log is not None and event.trial == self.trial:
            if not isinstance(event, Ended):
                self.log.step(event.step)
            else:
                if event.recording is not None:
                    self.log.end(event.recording)
                self.end_stream()
        if self.stream is not None:
            self.stream.flush(timeout_sec=ANSWER_S)

    def end_stream(self) -> None:
        """Leave the trial that is shown."""
        if self.stream is not None:
            self.stream.flush(timeout_sec=ANSWER_S)
            self.stream.disconnect()
        self.stream, self.log = None, None

    def _begin(self, event: Begun) -> None:
        self.end_stream()
        knock(self.url)
        start = event.start
        stream = rr.RecordingStream(KIND, send_properties=False)
        stream.set_log_time_enabled(False)
        x_m, y_m = start.overhead.pose_base_tool[:2, 3].tolist()
        ranges = TraceRanges.of(
            start.station,
            start.overhead,
            last_step=METHODS[start.method].max_steps,
            middle_m=(x_m, y_m),
            step_mm=STEP_MM,
            turn_deg=TURN_DEG,
            time_ms=TIME_MS,
            slope=SLOPE,
            input_px=64,
        )
        stream.connect_grpc(self.url, default_blueprint=trace_blueprint(ranges, following=True))
        stream.send_recording_name(f"{start.method} · trial {start.number}")
        self.trial, self.stream, self.log = event.trial, stream, TraceLog(stream, start, self.arm, live=True)
        self.log.begin()


def knock(url: str) -> None:
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


def main() -> None:
    """Show what comes through standard input, until it ends."""
    os.nice(NICENESS)
    os.write(sys.stdout.fileno(), b"!")  # Everything is imported.
    pipe = os.fdopen(sys.stdin.fileno(), "rb", closefd=False)
    try:
        watch: Watch = receive(pipe)
        showing = Showing(watch.url, watch.arm)
        while True:
            try:
                event = receive(pipe)
            except EOFError:
                break
            showing.show(event)
        showing.end_stream()
    except Exception as error:
        print(first_line(error), file=sys.stderr, flush=True)
        # At once: Rerun would wait at the end of the process for a viewer that does not answer.
        os._exit(1)


if __name__ == "__main__":
    main()
