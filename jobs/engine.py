"""Where work is computed: the seam between those who hand it out and the processes that do it, here or elsewhere."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Protocol

from handsight.jobs.processes import kill_processes, process_pool


class Engine(Protocol):
    """Starts workers for :func:`~.ordered.map_ordered`."""

    def start_worker(self) -> Executor:
        """Start a worker: an executor over one process that answers one call at a time, in the order of submission.

        Calls and answers are pickled. Calls that a worker leaves without an answer because its process ended raise
        :class:`~concurrent.futures.BrokenExecutor`; so does submitting to it afterwards.
        """

    def kill_worker(self, worker: Executor) -> None:
        """End a worker at once, in the middle of a call; it is shut down afterwards as any other."""


@dataclass(frozen=True, slots=True)
class LocalEngine:
    """Processes of this machine. They leave Ctrl-C to this one."""

    def start_worker(self) -> Executor:
        """Start a process; it ends with this one, even when this one is killed."""
        return process_pool(1)

    def kill_worker(self, worker: Executor) -> None:
        """Kill its process."""
        kill_processes(worker)


LOCAL = LocalEngine()
