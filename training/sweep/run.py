"""A sweep, run: cells that nobody else has go to workers, and what they come to is kept as soon as it is known."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import asdict, dataclass

from handsight import __version__
from handsight.datasets.held import HeldFile
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.datasets.machine import said_by
from handsight.jobs.engine import LOCAL, Engine
from handsight.jobs.unordered import map_unordered
from handsight.training.errors import SweepPlanError
from handsight.training.sweep.cell import ALL, Cell
from handsight.training.sweep.folder import SweepFolder
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.result import CellResult
from handsight.training.sweep.work import CellTask, SweepContextFactory, train_cell


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepReport:
    """What a call has done, and what is left."""

    trained: int
    failed: int
    """Cells that failed, in this call or before."""
    elsewhere: int
    """Cells that other processes are training."""


def run_sweep(
    plan: SweepPlan,
    folder: SweepFolder,
    *,
    workers: int,
    engine: Engine = LOCAL,
    data: Sequence[GraspInputs] | None = None,
    chosen: Callable[[Cell], bool] = lambda _: True,
    on_cell: Callable[[Cell, CellResult | None], None] | None = None,
) -> SweepReport:
    """Train all cells of a plan that are neither done nor failed nor in other hands.

    A cell that fails is kept as such and stops no other. What is wrong with the machine, such as a full disk, ends the
    call; all that is done stays.

    Args:
        plan: As the folder has it.
        folder: Where cells are kept.
        workers: Number of processes.
        engine: Where they run.
        data: Inputs of the plan's datasets, if they are open; processes of this machine then do not open them again.
        chosen: Which cells to train; all of them, unless told otherwise.
        on_cell: Called with each cell and its result, or None where it failed.

    Raises:
        OSError: The disk is full or not writable; the message names the cell.
        WorkerDiedError: Workers cannot be started.
    """
    held: dict[Cell, HeldFile] = {}
    cells = [cell for cell in plan.cells() if chosen(cell)]
    # Workers elsewhere may not see the folder: what they have of a cell is lost with them.
    keeps = engine is LOCAL
    trained = 0

    def claimed() -> Iterator[CellTask]:
        for cell in cells:
            state = folder.state(cell)
            if state == "done":
                folder.tidy(cell)
            elif state == "left" and (lock := folder.claim(cell)) is not None:
                held[cell] = lock
                recipe = cell.settings(plan.recipe, plan.training_seed(cell.trial))
                folder.write_config(cell, {"settings": asdict(recipe), "handsight": __version__})
                yield CellTask(cell=cell, checkpoint=folder.checkpoint(cell).absolute() if keeps else None)

    opener = SweepContextFactory(plan, tuple(data) if data and keeps else None)
    outcomes = map_unordered(opener, train_cell, claimed(), workers=workers, engine=engine, noun="cell")
    try:
        for task, outcome in outcomes:
            with naming(task.cell):
                result = kept_result(folder, task.cell, outcome)
            trained += result is not None
            held.pop(task.cell).release()
            if on_cell is not None:
                on_cell(task.cell, result)
    finally:
        outcomes.close()
        for lock in held.values():
            lock.release()
    states = [folder.state(cell) for cell in cells]
    return SweepReport(trained=trained, failed=states.count("failed"), elsewhere=states.count("running"))


def chosen_by(texts: Collection[str], plan: SweepPlan) -> Callable[[Cell], bool]:
    """Which cells ``--only`` means: ``CHANNELS``, ``CHANNELS:SIZE`` or ``CHANNELS:SIZE:TRIAL``, any of several.

    Instead of its channels a cell can be named by its series, such as ``depth noisy@v1`` where there are two datasets.

    Raises:
        SweepPlanError: Something names no cell of the plan.
    """
    names, wanted = plan.dataset_names, set(texts)
    named = {cell: wanted & set(_called(cell, names)) for cell in plan.cells()}
    if unknown := wanted.difference(*named.values()):
        series = sorted({cell.series(names) for cell in named})
        raise SweepPlanError(
            f"--only {', '.join(sorted(unknown))} names no cell of the plan, expected CHANNELS, CHANNELS:SIZE or "
            f"CHANNELS:SIZE:TRIAL of those that it has, or for CHANNELS one of its series: {', '.join(series)}"
        )
    return lambda cell: not wanted or bool(named[cell])


def _called(cell: Cell, datasets: Sequence[str]) -> Iterator[str]:
    size = ALL if cell.size is None else str(cell.size)
    for series in {cell.channels, cell.series(datasets)}:
        yield from (series, f"{series}:{size}", f"{series}:{size}:{cell.trial}")


def kept_result(folder: SweepFolder, cell: Cell, outcome: Future[CellResult]) -> CellResult | None:
    """Write what became of a cell; None where it failed.

    Raises:
        Exception: The machine failed, not the cell.
    """
    error = outcome.exception()
    if error is None:
        folder.write_result(cell, outcome.result())
        return outcome.result()
    if isinstance(error, OSError) or said_by(error) is not None:
        raise error
    folder.write_failure(cell, error, "".join(traceback.format_exception(error)))
    return None


@contextmanager
def naming(cell: Cell) -> Iterator[None]:
    """Say in errors of the operating system which cell it was that could not be kept."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        said = f"{error.strerror}, over cell {cell.name}; all that is done is kept"
        raise OSError(error.errno, said, error.filename) from error
