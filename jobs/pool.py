"""Workers with a context of their own, and the tasks that they have in hand.

A worker that dies is replaced and what it owed is computed again; as an answer depends on its task alone, nobody can
tell afterwards.
"""

from __future__ import annotations

import atexit
import heapq
import logging
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from typing import Any, Generic, Protocol, TypeVar

from handsight.jobs.engine import Engine
from handsight.jobs.errors import WorkerDiedError


class Closable(Protocol):
    """What a worker holds open."""

    def close(self) -> None:
        """Let go of it."""


Context = TypeVar("Context", bound=Closable)
Task = TypeVar("Task")
Answer = TypeVar("Answer")

DEATHS_TO_GIVE_UP = 3

_log = logging.getLogger(__name__)

_context: Any = None
"""What this worker process opened once: a station, perhaps with a network."""


def _init_worker(worker_init: Callable[[], Closable]) -> None:
    global _context
    _context = worker_init()
    atexit.register(_context.close)


def _answer(work: Callable[[Any, Any], Any], task: Any) -> Any:
    return work(_context, task)


@dataclass(slots=True)
class _Slot:
    """A worker, the calls it owes, and how many in a row died here before they were ready."""

    worker: Executor
    opening: Future[None]
    calls: deque[tuple[int, Future[Any]]] = field(default_factory=deque)
    ready: bool = False
    deaths: int = 0

    @property
    def next_future(self) -> Future[Any] | None:
        """The one that is done first: a worker answers in order."""
        if not self.ready:
            return self.opening
        return self.calls[0][1] if self.calls else None


class Pool(Generic[Task, Answer]):
    """The workers and the tasks in hand, from the oldest unanswered one to the newest one taken.

    Args:
        engine: Where the workers run.
        worker_init: Opens what a worker needs for all of its tasks.
        work: Computes one answer.
        workers: Number of processes.
        noun: What messages call a task.
        ahead: Tasks in hand for each worker.
        calls: Of these, how many a worker is given at a time.
    """

    def __init__(
        self,
        engine: Engine,
        worker_init: Callable[[], Closable],
        work: Callable[[Any, Task], Answer],
        *,
        workers: int,
        noun: str,
        ahead: int,
        calls: int,
    ) -> None:
        self._engine = engine
        self._init_worker = partial(_init_worker, worker_init)
        self._work = partial(_answer, work)
        self._ahead = ahead
        self._calls = calls
        self._workers = workers
        self._noun = noun
        self._slots: list[_Slot] = []
        self._tasks: dict[int, Task] = {}
        self._to_do: list[int] = []  # A heap: what a dead worker owed goes before newer tasks.
        self._done: dict[int, Future[Answer]] = {}
        self._deaths: Counter[int] = Counter()
        self._failure: BaseException | None = None

    def in_order(self, tasks: Iterable[Task]) -> Iterator[Answer]:
        """Every answer, in the order of the tasks."""
        supply = enumerate(tasks)
        head = 0
        while True:
            if not self._advance(supply):
                return
            if head in self._done:
                del self._tasks[head]
                yield self._done.pop(head).result()
                head += 1
            elif self._failure is not None:
                raise self._failure
            else:
                self._wait()

    def as_completed(self, tasks: Iterable[Task]) -> Iterator[tuple[Task, Future[Answer]]]:
        """Every task with its answer or error, as soon as it is there."""
        supply = enumerate(tasks)
        while True:
            if not self._advance(supply):
                return
            if self._done:
                number = min(self._done)
                yield self._tasks.pop(number), self._done.pop(number)
            elif self._failure is not None:
                raise self._failure
            else:
                self._wait()

    def kill(self) -> None:
        """End all workers in the middle of their calls."""
        for slot in self._slots:
            self._engine.kill_worker(slot.worker)
        self.shutdown()

    def shutdown(self) -> None:
        """End all workers at a time. Calls that have begun are waited for."""
        # In threads: a pool that was told to end without being waited for cannot be waited for afterwards, and one
        # that still ends while Python does leaves a traceback behind.
        with ThreadPoolExecutor(max(1, len(self._slots))) as shutdowns:
            list(shutdowns.map(lambda slot: slot.worker.shutdown(wait=True, cancel_futures=True), self._slots))

    def _advance(self, supply: Iterator[tuple[int, Task]]) -> bool:
        """Take tasks, collect what is done, and hand out the next; whether there is a task in hand."""
        self._take(supply)
        if self._tasks and self._failure is None:
            self._collect_answers()
            self._hand_out()
        return bool(self._tasks)

    def _wait(self) -> None:
        """Until a worker has done something."""
        wait([one for slot in self._slots if (one := slot.next_future)], return_when=FIRST_COMPLETED)

    def _take(self, supply: Iterator[tuple[int, Task]]) -> None:
        """Fill the window with tasks, and slots with no more workers than there are tasks."""
        for number, task in islice(supply, self._ahead * self._workers - len(self._tasks)):
            self._tasks[number] = task
            heapq.heappush(self._to_do, number)
        while len(self._slots) < min(self._workers, len(self._tasks)):
            self._slots.append(_Slot(*self._spawn()))

    def _spawn(self) -> tuple[Executor, Future[None]]:
        worker = self._engine.start_worker()
        return worker, _submit(worker, self._init_worker)

    def _hand_out(self) -> None:
        """Give every ready worker enough to do, all of them one call before any of them a second."""
        for depth in range(self._calls):
            for slot in self._slots:
                if self._to_do and slot.ready and len(slot.calls) == depth:
                    number = heapq.heappop(self._to_do)
                    slot.calls.append((number, _submit(slot.worker, self._work, self._tasks[number])))

    def _collect_answers(self) -> None:
        """Take what the workers have finished, and replace those that died."""
        for slot in self._slots:
            if not slot.ready and slot.opening.done():
                self._on_started(slot)
            while slot.calls and slot.calls[0][1].done():
                number, answer = slot.calls[0]
                if isinstance(answer.exception(), BrokenExecutor):
                    self._replace(slot, number)
                    break
                slot.calls.popleft()
                self._deaths.pop(number, None)
                self._done[number] = answer

    def _on_started(self, slot: _Slot) -> None:
        """See whether a worker could open its context. What it cannot open, no other one will."""
        failure = slot.opening.exception()
        if failure is None:
            slot.ready, slot.deaths = True, 0
        elif not isinstance(failure, BrokenExecutor):
            self._failure = failure
        else:
            slot.deaths += 1
            if slot.deaths == DEATHS_TO_GIVE_UP:
                oldest = self._name(min(self._tasks))
                self._failure = WorkerDiedError(
                    f"{oldest}: {DEATHS_TO_GIVE_UP} workers in a row ended while they opened their contexts "
                    "(killed, or out of memory)"
                )
                return
            _log.warning("a worker ended before it was ready (killed, or out of memory); it is replaced")
            self._restart(slot)

    def _replace(self, slot: _Slot, number: int) -> None:
        """Put another worker in the place of one that died over the task ``number``, the oldest it owed."""
        self._deaths[number] += 1
        owed = [one for one, _ in slot.calls]
        if self._deaths[number] == DEATHS_TO_GIVE_UP:
            # Told in its turn, behind the answers to older tasks.
            owed.remove(number)
            self._done[number] = Future()
            self._done[number].set_exception(
                WorkerDiedError(
                    f"{self._name(number)}: {DEATHS_TO_GIVE_UP} workers in a row ended over it without an answer "
                    "(killed, or out of memory)"
                )
            )
        for one in owed:
            heapq.heappush(self._to_do, one)
        _log.warning("a worker ended over %s (killed, or out of memory); it is replaced", self._name(number))
        self._restart(slot)

    def _restart(self, slot: _Slot) -> None:
        slot.worker.shutdown(wait=False)
        slot.calls.clear()
        slot.ready = False
        slot.worker, slot.opening = self._spawn()

    def _name(self, number: int) -> str:
        return f"{self._noun} {self._tasks[number]}"


def _submit(worker: Executor, call: Callable[..., Any], *arguments: Any) -> Future[Any]:
    """As ``worker.submit``, but a worker found dead gives a future like one that dies a moment later."""
    try:
        return worker.submit(call, *arguments)
    except BrokenExecutor as error:
        broken: Future[Any] = Future()
        broken.set_exception(error)
        return broken
