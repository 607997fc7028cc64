"""Many tasks on several workers, each with a context of its own, answered in order.

Tasks are handed out a few ahead of the oldest unanswered one, which bounds memory and makes the order of answers
independent of who was faster. A worker that dies is replaced and what it owed is computed again; as an answer depends
on its task alone, nobody can tell afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable

from handsight.jobs.engine import LOCAL, Engine
from handsight.jobs.pool import Answer, Context, Pool, Task

AHEAD_PER_WORKER = 4
CALLS_PER_WORKER = 2
"""One that is computed and one behind it, so that no worker idles while the one who asks is busy with an answer."""


def map_ordered(
    worker_init: Callable[[], Context],
    work: Callable[[Context, Task], Answer],
    tasks: Iterable[Task],
    *,
    workers: int,
    engine: Engine = LOCAL,
    noun: str = "task",
) -> Generator[Answer, None, None]:
    """``work(context, task)`` for every task, in the order of the tasks, on ``workers`` processes.

    ``worker_init`` is called once in each process; it, ``work``, tasks and answers must survive pickling. The answers
    depend neither on the engine, nor on the number of workers, nor on their deaths, as long as ``work`` leaves
    nothing behind on its context. Close the iterator to end the workers early.

    Args:
        worker_init: Opens what a worker needs for all of its tasks.
        work: Computes one answer.
        tasks: Taken one by one, as there is room for them.
        workers: Number of processes.
        engine: Where they run.
        noun: What messages call a task.

    Raises:
        WorkerDiedError: Three workers in a row ended over the same task, for instance killed for memory, after all
            answers before it were given; or three in a row while opening their contexts.
        Exception: Whatever ``worker_init`` or ``work`` raised, the latter in the place of its answer.
    """
    pool: Pool[Task, Answer] = Pool(
        engine, worker_init, work, workers=workers, noun=noun, ahead=AHEAD_PER_WORKER, calls=CALLS_PER_WORKER
    )
    try:
        yield from pool.in_order(tasks)
    finally:
        pool.shutdown()
