"""Long tasks on several workers, each answered as soon as it is done.

A task is taken when a worker is free for it and not before, so that whoever hands out tasks can share them with other
processes until the last moment.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future

from handsight.jobs.engine import LOCAL, Engine
from handsight.jobs.pool import Answer, Context, Pool, Task


def map_unordered(
    worker_init: Callable[[], Context],
    work: Callable[[Context, Task], Answer],
    tasks: Iterable[Task],
    *,
    workers: int,
    engine: Engine = LOCAL,
    noun: str = "task",
) -> Generator[tuple[Task, Future[Answer]], None, None]:
    """Every task with what became of ``work(context, task)``, in the order in which workers finish.

    One task that fails stops no other: what ``work`` raised is in its future, as is a :class:`~.errors.WorkerDiedError`
    where three workers in a row ended over it. When the iterator is closed, workers are killed in the middle of their
    tasks. For the arguments see :func:`~.ordered.map_ordered`.

    Raises:
        WorkerDiedError: Three workers in a row ended while opening their contexts.
        Exception: Whatever ``worker_init`` raised.
    """
    pool: Pool[Task, Answer] = Pool(engine, worker_init, work, workers=workers, noun=noun, ahead=1, calls=1)
    try:
        yield from pool.as_completed(tasks)
    except BaseException:
        # Closed early, or interrupted: a long task would be waited for, and nobody wants its answer.
        pool.kill()
        raise
    pool.shutdown()
