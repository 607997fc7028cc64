"""Worker processes that leave Ctrl-C to the process that started them, and do not outlive it."""

from __future__ import annotations

import atexit
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from types import FrameType
from typing import Any, NoReturn

_GRACE_S = 2.0
"""So long a process that is asked to end may take."""

# The kernel is asked, as such a program asks nobody: it sends the signal when the parent is gone, unless that was
# before it was asked.
_BOUND = """
import ctypes, os, signal, sys
parent, *command = sys.argv[1:]
libc = ctypes.CDLL(None)
if hasattr(libc, "prctl"):
    libc.prctl(1, signal.SIGKILL)
    if os.getppid() != int(parent):
        sys.exit(1)
os.execvp(command[0], command)
"""


def bound_command(command: Sequence[str]) -> list[str]:
    """The command of a program that is to end with this process, even when it is killed.

    To be started by a thread that lives as long as the program is wanted. Where there is no ``prctl``, as on macOS, the
    program outlives a killed process.
    """
    return [sys.executable, "-I", "-S", "-c", _BOUND, str(os.getpid()), *command]


def process_pool(workers: int, prepare: Callable[..., object] | None = None, *arguments: object) -> ProcessPoolExecutor:
    """A pool of processes, each of which first calls ``prepare`` with the arguments, if given.

    They are spawned, not forked: neither Icechunk nor PyBullet survives a fork. They end with this process, even when
    it is killed.
    """
    return ProcessPoolExecutor(workers, _QuietContext(), initializer=_settle_in, initargs=(prepare, arguments))


def kill_processes(pool: Executor) -> None:
    """End the processes of a pool that :func:`process_pool` made; calls without an answer are broken then.

    They are asked to first, so that they put away what they have registered with the system.
    """
    # ``ProcessPoolExecutor.terminate_workers`` comes with Python 3.14.
    processes = list((getattr(pool, "_processes", None) or {}).values())
    for process in processes:
        process.terminate()
    deadline = time.monotonic() + _GRACE_S
    for process in processes:
        if not wait([process.sentinel], timeout=max(0.0, deadline - time.monotonic())):
            process.kill()


class _QuietProcess(SpawnProcess):
    """A process that Ctrl-C does not reach while it starts either, when Python would answer with a traceback."""

    def start(self) -> None:
        """Start with the signal blocked; what this thread blocks, the new process blocks from its first instruction."""
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


class _QuietContext(SpawnContext):
    """Spawns such processes."""

    Process = _QuietProcess


def _settle_in(prepare: Callable[..., object] | None, arguments: tuple[Any, ...]) -> None:
    # Ctrl-C reaches the whole process group; the parent alone decides how to stop.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave_at_once)
    _leave_with_the_parent()
    if prepare is not None:
        prepare(*arguments)


def _leave_at_once(number: int, frame: FrameType | None) -> NoReturn:
    """End in the middle of a call. As an exception the end would be the answer of the call."""
    atexit._run_exitfuncs()
    os._exit(128 + number)


def _leave_with_the_parent() -> None:
    """End this process when the parent is gone, even killed: a pool's workers would wait for tasks for ever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="watch-parent", daemon=True).start()
