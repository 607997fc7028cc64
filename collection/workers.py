"""Many attempts on several processes, each with a station of its own, answered in order.

Processes are spawned, not forked: neither PyBullet nor Icechunk survives a fork. Work is handed out a few attempts
ahead of the oldest unanswered one, which bounds memory and makes the order of answers independent of who was faster.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol, TypeVar

from handsight.collection.errors import WorkerDiedError


class Closable(Protocol):
    """What a worker holds open."""

    def close(self) -> None:
        """Let go of it."""


Bench = TypeVar("Bench", bound=Closable)
Task = TypeVar("Task")
Answer = TypeVar("Answer")

AHEAD_PER_WORKER = 4

_bench: Any = None
"""What this worker process opened once: a station, perhaps with a network."""


def _open_bench(open_bench: Callable[[], Closable]) -> None:
    _leave_with_the_parent()
    # Ctrl-C reaches the whole process group; the parent alone decides how to stop.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    global _bench
    _bench = open_bench()
    atexit.register(_bench.close)


def _leave_with_the_parent() -> None:
    """End this process when the parent is gone, even killed: a pool's workers would wait for tasks for ever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="watch-parent", daemon=True).start()


def _answer(work: Callable[[Any, Any], Any], task: Any) -> Any:
    return work(_bench, task)


def answers_in_order(
    open_bench: Callable[[], Bench], work: Callable[[Bench, Task], Answer], tasks: Iterable[Task], *, workers: int
) -> Iterator[Answer]:
    """``work(bench, task)`` for every task, in the order of the tasks, on ``workers`` processes.

    ``open_bench`` is called once in each process; it, ``work``, tasks and answers must survive pickling. The answers
    do not depend on the number of workers as long as ``work`` leaves nothing behind on its bench.

    Raises:
        WorkerDiedError: A process ended without an answer, for instance killed for memory.
    """
    pool = ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=_open_bench, initargs=(open_bench,)
    )
    waiting: deque[Future[Answer]] = deque()
    try:
        for task in tasks:
            waiting.append(pool.submit(_answer, work, task))
            if len(waiting) >= AHEAD_PER_WORKER * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    except BrokenProcessPool as error:
        raise WorkerDiedError(
            "a worker process ended without an answer (killed, or out of memory): "
            "what is committed is safe; run again with --resume, perhaps with fewer workers"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
