"""Servo runs in a viewer while they happen: handed to a program of their own, for which nobody waits.

Steps are handed over through a short queue to a thread, which does no more than write them into the program's pipe.
Where the program falls behind, the oldest step that waits is dropped, and the beginning of no trial while there is one;
where the viewer stops answering or the program ends, everything is, after one warning. Servoing never notices either.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Final, cast

from handsight.evaluation.trial import TrialRecording
from handsight.evaluation.watching import TrialStart
from handsight.jobs.processes import bound_command
from handsight.servoing.loop import ServoStep
from handsight.viz.recordings.live_wire import Begun, Ended, Event, Passed, Watch, first_line, send

if TYPE_CHECKING:
    # Rerun is imported where pictures are made, in the program.
    from handsight.viz.recordings.arm_drawing import DrawnArm

PROGRAM: Final = "handsight.viz.recordings.live_program"
WAITING: Final = 16
"""Steps that wait for the program at most: a whole run of most methods."""
START_S: Final = 20.0
"""So long the end of the trials waits for a program that has yet to import what it needs, on a busy machine."""
CLOSE_S: Final = 5.0
"""So long it waits then for what is still to be shown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveFactory:
    """Opens a stream to a viewer in any process."""

    url: str
    """Of the viewer."""
    arm: DrawnArm | None = None
    warn: Callable[[str], None] | None = None
    """Told once, in a line, if the viewer stops answering; must survive pickling. None says nothing."""

    def __call__(self) -> LiveTrace:
        """Open it; whether the viewer is there is found out by the program."""
        return LiveTrace(self.url, arm=self.arm, warn=self.warn)


class Waiting:
    """A queue of bounded length, from whose front is dropped what it has no room for."""

    def __init__(self, most: int) -> None:
        """Nothing waits yet."""
        self.dropped = 0
        self._most = most
        self._events: deque[Event | None] = deque()
        self._changed = threading.Condition()

    def __len__(self) -> int:
        return len(self._events)

    def put(self, event: Event | None) -> None:
        """Append an event; None ends the queue. Never waits."""
        with self._changed:
            if len(self._events) >= self._most:
                # A step rather than the beginning of a trial, of which nothing would then be shown.
                at = next((at for at, waits in enumerate(self._events) if isinstance(waits, Passed)), 0)
                del self._events[at]
                self.dropped += 1
            self._events.append(event)
            self._changed.notify()

    def get(self) -> Event | None:
        """The oldest event, once there is one."""
        with self._changed:
            self._changed.wait_for(lambda: self._events)
            return self._events.popleft()


class LiveTrace:
    """A :class:`~handsight.evaluation.watching.TrialWatcher` that shows trials in a viewer.

    The program ends with the thread that begins the watching, even when its process is killed.
    """

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
        self._events = Waiting(WAITING)
        self.started = threading.Event()
        """Once the program takes events, or has ended."""
        self._gone = threading.Event()
        self._late = False
        self.program: subprocess.Popen[bytes] | None = None
        """What shows the steps; None where the system started none."""
        log = tempfile.TemporaryFile()  # noqa: SIM115 - closed by the thread, which reads it last.
        try:
            self.program = _start_program(log)
        except OSError as error:
            log.close()
            self._leave(str(error))
            return
        self._thread = threading.Thread(
            target=self._hand_over, args=(self.program, Watch(url, arm), log), name="handsight-live", daemon=True
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
        self._put(Begun(self._trial, start))

    def step(self, step: ServoStep) -> None:
        """The loop has looked and chosen."""
        self._put(Passed(self._trial, step))

    def end(self, recording: TrialRecording | None) -> None:
        """The grasp was executed."""
        self._put(Ended(self._trial, recording))

    def close(self) -> None:
        """Wait a little for what is still to be shown, and leave the rest."""
        if self.program is None:
            return
        self._put(None)
        try:
            self.started.wait(START_S)
            self._thread.join(CLOSE_S)
        finally:
            if self._thread.is_alive():
                self._late = True
                self.program.kill()
            self._thread.join()

    def _put(self, event: Event | None) -> None:
        if not self._gone.is_set():
            self._events.put(event)

    def _hand_over(self, program: subprocess.Popen[bytes], watch: Watch, log: IO[bytes]) -> None:
        """The thread: write one event after another, and in the end ask the program how it fared."""
        with log:
            fault = self._feed(program, watch)
            status = program.wait()
            if fault or status:
                self._leave(fault or self._reason(log, status))

    def _feed(self, program: subprocess.Popen[bytes], watch: Watch) -> str:
        """Write events until no more follow or nobody reads them; returns what else went wrong, if anything did."""
        pipe, answer = cast("tuple[IO[bytes], IO[bytes]]", (program.stdin, program.stdout))
        try:
            with pipe, answer:
                answer.read(1)
                self.started.set()
                send(pipe, watch)
                while (event := self._events.get()) is not None:
                    send(pipe, event)
        except OSError:
            pass  # The program has ended, and has said why.
        except Exception as error:  # To be watched must not end a servo run, whatever is wrong with it.
            program.kill()
            return first_line(error)
        return ""

    def _reason(self, log: IO[bytes], status: int) -> str:
        if self._late:
            return f"not everything was shown {CLOSE_S:g} s after the end"
        log.seek(0)
        said = log.read().decode(errors="replace").strip().splitlines()
        return said[-1] if status > 0 and said else f"the program that shows steps ended with status {status}"

    def _leave(self, reason: str) -> None:
        self._gone.set()
        if self._warn is not None:
            self._warn(f"the viewer stopped answering, servoing goes on without it ({reason})")


def _start_program(log: IO[bytes]) -> subprocess.Popen[bytes]:
    """The program, whose errors go to a file; it ends with this thread, and hears of no Ctrl-C.

    Raises:
        OSError: The system starts no more.
    """
    return subprocess.Popen(
        bound_command([sys.executable, "-P", "-m", PROGRAM]),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=log,
        bufsize=0,
        # What Rerun says of a viewer that went away is said in one line.
        env={"RUST_LOG": "off", **os.environ},
        # Ctrl-C reaches a whole process group, and this process alone decides what then happens.
        start_new_session=True,
    )
