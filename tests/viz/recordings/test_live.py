"""Servo runs while they happen: a viewer gets what a file would, and one that does not answer is left."""

from __future__ import annotations

import dataclasses
import os
import pickle
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from tests.support.rrd import Content, read_received, read_recording

from handsight.collection.sim.arm_shape import Ur10Shape
from handsight.evaluation.trial import TrialRecording
from handsight.viz.recordings import live
from handsight.viz.recordings.live import LiveFactory, LiveTrace, Waiting
from handsight.viz.recordings.live_wire import Begun, Event, Passed
from handsight.viz.recordings.servo_trace import trial_start, write_servo_trace
from handsight.viz.recordings.viewer_process import free_port, running_viewer

TIMELINE = "servo_step"
LIMIT_S = 60.0


@pytest.fixture(autouse=True)
def _patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is to be shown is waited for, however busy the machine is; one test says otherwise."""
    monkeypatch.setattr(live, "START_S", LIMIT_S)
    monkeypatch.setattr(live, "CLOSE_S", LIMIT_S)


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
    watcher = LiveTrace(f"rerun+http://127.0.0.1:{free_port()}/proxy", warn=warnings.append)
    for _ in range(3):
        watch(watcher, trial)
    watcher.close()
    assert watcher.gone
    (warning,) = warnings
    assert warning.startswith("the viewer stopped answering, servoing goes on without it (")
    assert "refused" in warning
    watch(watcher, trial)  # and nothing more is said or kept
    watcher.close()
    assert len(warnings) == 1


def test_a_viewer_that_stops_answering_holds_up_neither_the_run_nor_the_end(trial: TrialRecording) -> None:
    """Rerun waits at the end of a process for ever for such a viewer: the program that shows steps does not."""
    warnings: list[str] = []
    with deaf_listener() as port:
        watcher = LiveTrace(f"rerun+http://127.0.0.1:{port}/proxy", warn=warnings.append)
        for _ in range(40):
            watch(watcher, trial)
        assert watcher.dropped > 0
        watcher.close()
    assert watcher.gone
    (warning,) = warnings
    assert warning.startswith("the viewer stopped answering")


def program_of(watcher: LiveTrace) -> subprocess.Popen[bytes]:
    assert watcher.program is not None
    return watcher.program


def test_a_program_that_stands_still_holds_up_nothing_and_is_ended(
    trial: TrialRecording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "CLOSE_S", 0.5)
    warnings: list[str] = []
    watcher = LiveTrace("rerun+http://127.0.0.1:1/proxy", warn=warnings.append)
    assert watcher.started.wait(LIMIT_S)
    program_of(watcher).send_signal(signal.SIGSTOP)
    for _ in range(10):
        watch(watcher, trial)
    assert watcher.dropped > 0
    assert warnings == []
    watcher.close()
    assert program_of(watcher).poll() == -signal.SIGKILL
    (warning,) = warnings
    assert warning.endswith("(not everything was shown 0.5 s after the end)")


def test_a_program_that_dies_is_a_line_and_the_run_goes_on(trial: TrialRecording) -> None:
    warnings: list[str] = []
    watcher = LiveTrace("rerun+http://127.0.0.1:1/proxy", warn=warnings.append)
    program_of(watcher).kill()
    watch(watcher, trial)
    watcher.close()
    (warning,) = warnings
    assert warning.endswith("(the program that shows steps ended with status -9)")


def test_a_program_that_does_not_start_is_a_line(trial: TrialRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    warnings: list[str] = []
    watcher = LiveTrace("rerun+http://127.0.0.1:1/proxy", warn=warnings.append)
    watch(watcher, trial)
    watcher.close()
    (warning,) = warnings
    assert "/nowhere/python" in warning


def test_what_cannot_be_handed_over_is_a_line(trial: TrialRecording) -> None:
    class Unnameable:
        """Pickling finds no such class."""

    warnings: list[str] = []
    watcher = LiveTrace("rerun+http://127.0.0.1:1/proxy", arm=Unnameable(), warn=warnings.append)  # type: ignore[arg-type]
    watch(watcher, trial)
    watcher.close()
    (warning,) = warnings
    assert "Unnameable" in warning


WATCHING = """
import pickle, sys
from handsight.viz.recordings import live
from handsight.viz.recordings.live import LiveTrace
from handsight.viz.recordings.servo_trace import trial_start
live.CLOSE_S = 60.0
trial = pickle.load(open(sys.argv[2], "rb"))
watcher = LiveTrace(sys.argv[1], warn=lambda text: print("warned:", text, flush=True))
watcher.begin(trial_start(trial))
watcher.started.wait()
try:
    print(watcher.program.pid, flush=True)  # From here on the signal may come.
    sys.stdin.read()
except KeyboardInterrupt:
    watcher.close()
    print("closed", watcher.gone, flush=True)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="waits for a process that is no child of its own")
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
def test_no_program_outlives_the_run(trial: TrialRecording, tmp_path: Path, end: signal.Signals) -> None:
    """Neither a killed one, nor one that Ctrl-C ends, which reaches the whole process group."""
    saved, port = tmp_path / "trial.pickle", free_port()
    saved.write_bytes(pickle.dumps(trial))
    arguments = ["--serve-grpc", "--bind", "127.0.0.1", "--port", str(port)]
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    with (
        running_viewer(arguments, port),
        subprocess.Popen(
            [sys.executable, "-P", "-c", WATCHING, url, str(saved)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        ) as run,
    ):
        assert run.stdout is not None
        program = os.pidfd_open(int(run.stdout.readline()))
        gone = select.poll()
        gone.register(program, select.POLLIN)
        os.killpg(run.pid, end)
        # Ends the input too: Python may get the signal after its last look for one and before it reads.
        told = run.communicate(timeout=LIMIT_S)
        assert gone.poll(1e3 * LIMIT_S), "it goes on without the run"
        os.close(program)
    assert told == (("closed False\n", "") if end == signal.SIGINT else ("", ""))


def test_too_many_steps_push_out_the_oldest_and_no_beginning_of_a_trial(trial: TrialRecording) -> None:
    waiting, start, step = Waiting(4), trial_start(trial), trial.trace.steps[0]
    first, second = Begun(1, start), Begun(2, start)
    steps = [Passed(1, dataclasses.replace(step, score=number / 100)) for number in range(5)]
    events: list[Event] = [first, steps[0], second, *steps[1:]]
    for event in events:
        waiting.put(event)
    assert waiting.dropped == 3
    waiting.put(None)  # The end of the queue takes a place too.
    assert waiting.dropped == 4
    assert [waiting.get() for _ in range(4)] == [first, second, steps[4], None]


def test_of_a_queue_full_of_beginnings_the_oldest_goes(trial: TrialRecording) -> None:
    waiting, start = Waiting(2), trial_start(trial)
    begun = [Begun(number, start) for number in range(3)]
    for one in begun:
        waiting.put(one)
    assert [waiting.get(), waiting.get()] == begun[1:]
