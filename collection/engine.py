"""Where work is computed: the seam between those who hand it out and the processes that do it, here or elsewhere."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from typing import Protocol


class Engine(Protocol):
    """Starts workers for :func:`~.workers.answers_in_order`."""

    def start_worker(self) -> Executor:
        """Start a worker: an executor over one process that answers one call at a time, in the order of submission.

        Calls and answers are pickled. Calls that a worker leaves without an answer because its process ended raise
        :class:`~concurrent.futures.BrokenExecutor`; so does submitting to it afterwards.
        """


@dataclass(frozen=True, slots=True)
class LocalEngine:
    """Processes of this machine. They are spawned, not forked: neither PyBullet nor Icechunk survives a fork."""

    def start_worker(self) -> Executor:
        """Start a process; it ends with this one, even when this one is killed."""
        return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=_settle_in)


LOCAL = LocalEngine()


def _settle_in() -> None:
    # Ctrl-C reaches the whole process group; the parent alone decides how to stop.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _leave_with_the_parent()


def _leave_with_the_parent() -> None:
    """End this process when the parent is gone, even killed: a pool's workers would wait for tasks for ever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="watch-parent", daemon=True).start()
