"""Worker processes that leave Ctrl-C to the process that started them, and do not outlive it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

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
    spawn = multiprocessing.get_context("spawn")
    return _Pool(workers, spawn, initializer=_settle_in, initargs=(prepare, arguments))


class _Pool(ProcessPoolExecutor):
    """A pool whose processes are deaf to Ctrl-C from their first moment on, and not only once Python has started."""

    def submit(
        self, call: Callable[Arguments, Answer], /, *arguments: Arguments.args, **named: Arguments.kwargs
    ) -> Future[Answer]:
        with _interrupts_held_back():  # It is here that processes are started, and they inherit what is held back.
            return super().submit(call, *arguments, **named)


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Let Ctrl-C wait until the end of the block."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _settle_in(prepare: Callable[..., object] | None, arguments: tuple[Any, ...]) -> None:
    # Ctrl-C reaches the whole process group; the parent alone decides how to stop.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _leave_with_the_parent()
    if prepare is not None:
        prepare(*arguments)


def _leave_with_the_parent() -> None:
    """End this process when the parent is gone, even killed: a pool's workers would wait for tasks for ever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="watch-parent", daemon=True).start()
