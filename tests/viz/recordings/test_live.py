"""Servo runs while they happen: a viewer gets what a file would, and one that does not answer is left."""

from __future__ import annotations

import dataclasses
import pickle
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from tests.support.rrd import Content, read_received, read_recording

from handsight.collection.sim.arm_shape import Ur10Shape
from handsight.evaluation.trial import TrialRecording
from handsight.evaluation.watching import TrialStart
from handsight.servoing.loop import ServoStep
from handsight.viz.recordings import live
from handsight.viz.recordings.live import LiveFactory, LiveTrace
from handsight.viz.recordings.servo_trace import trial_start, write_servo_trace
from handsight.viz.recordings.viewer_process import free_port, running_viewer

TIMELINE = "servo_step"
LIMIT_S = 60.0


def watch(watcher: LiveTrace, trial: TrialRecording) -> None:
    watcher.begin(trial_start(trial))
    for step in trial.trace.steps:
        watcher.step(step)
    watcher.end(trial)


def shown(content: Content) -> Content:
    """What both show: not the layout, the text that a run under way has, and the name."""
    others = ("/__properties", "/text/trial")
    return {entity: rows for entity, rows in content.items() if not entity.startswith(others)}


def test_a_viewer_gets_what_a_file_has(trial: TrialRecording, arm: Ur10Shape, tmp_path: Path) -> None:
    port, received = free_port(), tmp_path / "received.rrd"
    arguments = ["--save", str(received), "--bind", "127.0.0.1", "--port", str(port)]
    warnings: list[str] = []
    with running_viewer(arguments, port) as receiver:
        watcher = LiveFactory(url=f"rerun+http://127.0.0.1:{port}/proxy", arm=arm, warn=warnings.append)()
        watch(watcher, trial)
        watcher.close()
        assert (watcher.gone, watcher.dropped, warnings) == (False, 0, [])
        receiver.send_signal(signal.SIGINT)
        receiver.wait(LIMIT_S)
    write_servo_trace(tmp_path / "trace.rrd", trial, arm=arm)
    written = shown(read_recording(tmp_path / "trace.rrd", timeline=TIMELINE))
    got = shown(read_received(received, timeline=TIMELINE))
    assert {entity: got.get(entity) for entity in written} == written
    assert len(written) > 30


@contextmanager
def deaf_listener() -> Iterator[int]:
    """A program that takes connections and never answers."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        kept: list[socket.socket] = []

        def accept() -> None:
            try:
                while True:
                    kept.append(listener.accept()[0])
            except OSError:
                return

        thread = threading.Thread(target=accept, daemon=True)
        thread.start()
        yield listener.getsockname()[1]
        listener.shutdown(socket.SHUT_RDWR)
        thread.join(LIMIT_S)
        for one in kept:
            one.close()


def test_nobody_who_listens_is_said_once_and_nothing_waits(trial: TrialRecording) -> None:
    warnings: list[str] = []
    switch_s = sys.getswitchinterval()
    watcher = LiveTrace(f"rerun+http://127.0.0.1:{free_port()}/proxy", warn=warnings.append)
    assert sys.getswitchinterval() <= live.SWITCH_S
    for _ in range(3):
        watch(watcher, trial)
    watcher.close()
    assert sys.getswitchinterval() == switch_s
    assert watcher.gone
    (warning,) = warnings
    assert warning.startswith("the viewer stopped answering, servoing goes on without it (")
    watch(watcher, trial)  # and nothing more is said or kept
    assert len(warnings) == 1


PROGRAM = """
import os, sys
os.environ["RUST_LOG"] = "off"
import pickle
from handsight.viz.recordings import live
live.ANSWER_S = 0.5
trial = pickle.load(open(sys.argv[2], "rb"))
from handsight.viz.recordings.servo_trace import trial_start
watcher = live.LiveTrace(sys.argv[1], warn=lambda text: print("warned:", text, flush=True))
watcher.begin(trial_start(trial))
for _ in range(40):
    for step in trial.trace.steps:
        watcher.step(step)
print("handed over", watcher.dropped > 0, len(watcher._events) <= live.WAITING, flush=True)
watcher.end(trial)
watcher.close()
print("closed", watcher.gone, flush=True)
"""


def test_a_viewer_that_stops_answering_holds_up_neither_the_run_nor_the_end(
    trial: TrialRecording, tmp_path: Path
) -> None:
    """Rerun waits at the end of a process for ever for such a viewer; a process of its own shows that it does not."""
    (tmp_path / "trial.pickle").write_bytes(pickle.dumps(trial))
    with deaf_listener() as port:
        command = [sys.executable, "-P", "-c", PROGRAM, f"rerun+http://127.0.0.1:{port}/proxy"]
        began = time.monotonic()
        done = subprocess.run(
            [*command, str(tmp_path / "trial.pickle")], capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert "handed over True True" in lines
    (warned,) = (line for line in lines if line.startswith("warned:"))
    assert warned.startswith("warned: the viewer stopped answering")
    assert lines[-1] == "closed True"
    assert done.stderr == ""
    assert time.monotonic() - began < LIMIT_S


def test_too_many_steps_push_out_the_oldest_and_no_beginning_of_a_trial(
    trial: TrialRecording, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken, held = threading.Event(), threading.Event()
    shown_of: list[tuple[int, float]] = []

    class Log:
        def __init__(self, number: int) -> None:
            self.number = number

        def step(self, step: ServoStep) -> None:
            shown_of.append((self.number, step.score))

    def begin(self: live._Showing, start: TrialStart, number: int) -> None:
        taken.set()
        held.wait(LIMIT_S)
        self.log, self.trial = Log(start.number), number  # type: ignore[assignment]

    monkeypatch.setattr(live._Showing, "begin", begin)
    watcher = LiveTrace("rerun+http://127.0.0.1:1/proxy")
    first, start = trial.trace.steps[0], trial_start(trial)
    watcher.begin(start)
    assert taken.wait(LIMIT_S)
    watcher.step(dataclasses.replace(first, score=0.0))
    watcher.begin(dataclasses.replace(start, number=start.number + 1))
    for number in range(1, 31):
        watcher.step(dataclasses.replace(first, score=number / 100))
    held.set()
    watcher.close()
    newest = [(start.number + 1, number / 100) for number in range(31 - len(shown_of), 31)]
    assert shown_of == newest
    assert len(shown_of) in (live.WAITING - 2, live.WAITING - 1)  # The end of the queue takes a place if it is early.
    assert watcher.dropped == 31 - len(shown_of)
