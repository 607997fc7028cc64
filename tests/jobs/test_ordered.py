"""Answers in order from workers that are slow, that fail and that die."""

from __future__ import annotations

import io
import multiprocessing
import operator
import threading
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handsight.jobs.errors import WorkerDiedError
from handsight.jobs.ordered import AHEAD_PER_WORKER, map_ordered

DEATHS = 3
"""Workers that a task may cost before the rest is given up."""


class Nothing:
    """The context of workers that need none."""

    def close(self) -> None:
        """Nothing to let go of."""


def squared(context: Nothing, task: int) -> int:
    return task * task


@dataclass
class FatalTasks:
    """An engine in this process, whose workers die over some tasks as often as told."""

    deaths: dict[int, int]
    fatal_openings: int = 0
    attempts: Counter[int] = field(default_factory=Counter)
    started: int = 0

    def start_worker(self) -> Executor:
        self.started += 1
        return MortalWorker(self)

    def kill_worker(self, worker: Executor) -> None:
        """Workers of this engine die over their tasks alone."""


class MortalWorker(ThreadPoolExecutor):
    """Computes in a thread. Once dead, no call gets an answer; one that comes later is refused at once."""

    def __init__(self, engine: FatalTasks) -> None:
        super().__init__(1)
        self.engine = engine
        self.dead = False

    def submit(self, fn: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        if self.dead:
            raise BrokenExecutor
        return super().submit(self._compute, fn, *arguments, **named)

    def _compute(self, fn: Any, *arguments: Any) -> Any:
        engine = self.engine
        if not arguments:
            engine.fatal_openings -= 1
            self.dead = engine.fatal_openings >= 0
        else:
            (task,) = arguments
            if not self.dead:
                engine.attempts[task] += 1
                self.dead = engine.attempts[task] <= engine.deaths.get(task, 0)
        if self.dead:
            raise BrokenExecutor
        return fn(*arguments)


@given(
    tasks=st.integers(0, 25),
    workers=st.integers(1, 4),
    deaths=st.dictionaries(st.integers(0, 25), st.integers(1, DEATHS - 1), max_size=6),
)
def test_every_answer_comes_once_and_in_order_whoever_dies(tasks: int, workers: int, deaths: dict[int, int]) -> None:
    engine = FatalTasks(deaths)
    answers = map_ordered(Nothing, squared, range(tasks), workers=workers, engine=engine)
    assert list(answers) == [task * task for task in range(tasks)]
    assert engine.started <= workers + sum(deaths.values())


@given(workers=st.integers(1, 4), fatal=st.integers(0, 12), deaths=st.dictionaries(st.integers(0, 12), st.just(2)))
def test_a_fatal_task_is_named_after_all_answers_before_it(workers: int, fatal: int, deaths: dict[int, int]) -> None:
    engine = FatalTasks(deaths | {fatal: 1000})
    answers = map_ordered(Nothing, squared, range(13), workers=workers, engine=engine, noun="attempt")
    assert [next(answers) for _ in range(fatal)] == [task * task for task in range(fatal)]
    with pytest.raises(WorkerDiedError, match=rf"^attempt {fatal}: 3 workers in a row ended over it"):
        next(answers)
    assert engine.attempts[fatal] == DEATHS


@given(workers=st.integers(1, 4))
def test_few_tasks_are_taken_ahead(workers: int) -> None:
    taken: list[int] = []

    def tasks() -> Iterator[int]:
        for task in range(100):
            taken.append(task)
            yield task

    answers = map_ordered(Nothing, squared, tasks(), workers=workers, engine=FatalTasks({}))
    for count, _ in enumerate(answers):
        assert len(taken) - count <= AHEAD_PER_WORKER * workers
    assert len(taken) == 100


def test_no_worker_is_started_for_nothing() -> None:
    engine = FatalTasks({})
    assert list(map_ordered(Nothing, squared, [], workers=4, engine=engine)) == []
    assert list(map_ordered(Nothing, squared, [3, 5], workers=4, engine=engine)) == [9, 25]
    assert engine.started == 2


def test_workers_that_die_before_they_are_ready_are_replaced() -> None:
    engine = FatalTasks({}, fatal_openings=2)
    assert list(map_ordered(Nothing, squared, range(9), workers=1, engine=engine)) == [n * n for n in range(9)]
    assert engine.started == 3


def test_workers_that_never_get_ready_end_it() -> None:
    engine = FatalTasks({}, fatal_openings=1000)
    with pytest.raises(WorkerDiedError, match=r"^task 0: 3 workers in a row ended while they opened their contexts"):
        next(map_ordered(Nothing, squared, range(9), workers=1, engine=engine))
    assert engine.started == DEATHS


def test_an_error_of_a_task_comes_in_its_turn() -> None:
    answers = map_ordered(Nothing, reciprocal, [2, 4, 0, 5], workers=3, engine=FatalTasks({}))
    assert [next(answers), next(answers)] == [0.5, 0.25]
    with pytest.raises(ZeroDivisionError):
        next(answers)


def reciprocal(context: Nothing, task: int) -> float:
    return 1 / task


def test_a_bench_that_cannot_be_opened_is_that_error(tmp_path: Path) -> None:
    """In real processes, whose starting code could fail without a word. A file stands for the context."""
    answers = map_ordered(partial(open, tmp_path / "missing"), read, range(3), workers=2)
    with pytest.raises(FileNotFoundError, match="missing"):
        next(answers)


def read(context: IO[str], task: int) -> str:
    return context.read(task)


def test_no_process_outlives_the_answers() -> None:
    """A pool that still ends while Python does would print a traceback."""
    # Of the standard library, because the processes know nothing of the tests.
    answers = map_ordered(io.StringIO, operator.is_, range(100), workers=2)
    assert not any(next(answers) for _ in range(3))
    before = multiprocessing.active_children()
    assert len(before) == 2
    answers.close()
    assert not any(process.is_alive() for process in before)
    assert not [one for one in threading.enumerate() if type(one).__name__ == "_ExecutorManagerThread"]
