"""Answers as they come: nothing is taken ahead, nothing is waited for that nobody wants."""

from __future__ import annotations

import io
import multiprocessing
import os
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from handsight.jobs.unordered import map_unordered


class Nothing:
    """The context of workers that need none."""

    def close(self) -> None:
        """Nothing to let go of."""


@dataclass
class Threads:
    """Workers in this process."""

    killed: list[Executor] = field(default_factory=list)

    def start_worker(self) -> Executor:
        return ThreadPoolExecutor(1)

    def kill_worker(self, worker: Executor) -> None:
        self.killed.append(worker)


def waiting(context: Nothing, task: threading.Event) -> bool:
    return task.wait(30)


def test_answers_come_as_they_are_done() -> None:
    first, second = threading.Event(), threading.Event()
    second.set()
    outcomes = map_unordered(Nothing, waiting, [first, second], workers=2, engine=Threads())
    task, answer = next(outcomes)
    assert task is second
    first.set()
    task, other = next(outcomes)
    assert task is first
    assert answer.result()
    assert other.result()
    assert list(outcomes) == []


def squared(context: Nothing, task: int) -> int:
    if task == 3:
        raise ValueError("three")
    return task**2


def test_one_that_fails_stops_no_other() -> None:
    found = {
        task: answer.exception() or answer.result()
        for task, answer in map_unordered(Nothing, squared, range(6), workers=2, engine=Threads())
    }
    assert isinstance(found.pop(3), ValueError)
    assert found == {task: task**2 for task in (0, 1, 2, 4, 5)}


def test_no_task_is_taken_before_a_worker_is_free_for_it() -> None:
    taken: list[int] = []

    def supply() -> Iterator[int]:
        for task in range(6):
            taken.append(task)
            yield task

    for count, _ in enumerate(map_unordered(Nothing, squared, supply(), workers=2, engine=Threads()), start=1):
        assert len(taken) <= count + 2


def test_a_task_that_nobody_waits_for_is_ended_with_its_process(tmp_path: Path) -> None:
    """Otherwise Ctrl-C would take as long as the longest of the tasks.

    Of the standard library, because the processes know nothing of the tests: two of them read from a pipe that has one
    byte.
    """
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writing = os.open(pipe, os.O_RDWR)
    try:
        outcomes = map_unordered(partial(io.FileIO, str(pipe)), io.FileIO.read, [1, 1], workers=2)
        os.write(writing, b"x")
        _, answer = next(outcomes)
        assert answer.result() == b"x"
        workers = multiprocessing.active_children()
        assert len(workers) == 2
        outcomes.close()
        assert not any(worker.is_alive() for worker in workers)
    finally:
        os.close(writing)
