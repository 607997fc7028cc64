"""A search, run: proposals are judged trial by trial, and the next follows from what became of those before.

::

    plan.json
    study.log                      Optuna's journal: every proposal, its values, its loss
    proposals/0007.lock            held by the process that has it judged
    proposals/0007-<digest>/       its cells, as a sweep keeps them (sweep/folder.py)
    best.json, proposals.csv       written at the end of every call

Any number of processes can share a folder. Each judges proposals of its own, and takes over those of processes that are
gone: cells that are done count, and one that was being trained goes on from its checkpoint.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from handsight import __version__
from handsight.datasets.held import HeldFile
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.jobs.engine import LOCAL, Engine
from handsight.jobs.unordered import map_unordered
from handsight.training.search.plan import SearchPlan, recipe_at
from handsight.training.search.study import PROPOSALS, Proposal, SearchStudy
from handsight.training.settings import TrainSettings
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.folder import SweepFolder
from handsight.training.sweep.result import CellResult
from handsight.training.sweep.run import kept_result, naming
from handsight.training.sweep.work import CellTask, SweepContext, SweepContextFactory, train_cell


@dataclass(frozen=True, slots=True, kw_only=True)
class ProposalTask:
    """A trial of a proposal."""

    proposal: int
    recipe: TrainSettings
    cell: Cell
    checkpoint: Path | None
    """None where the workers cannot see the folder of the search."""

    def __str__(self) -> str:
        return f"{self.proposal}, {self.cell.name}"


@dataclass(slots=True, kw_only=True)
class _Judged:
    """A proposal in the hands of this process."""

    proposal: Proposal
    recipe: TrainSettings
    folder: SweepFolder
    lock: HeldFile
    results: dict[int, CellResult]
    """By trial."""
    in_hand: set[int] = field(default_factory=set)
    """Trials that workers have."""
    over: bool = False


def train_proposal(context: SweepContext, task: ProposalTask) -> CellResult:
    """Train and test a cell as a sweep does whose recipe is the proposal; for errors see :func:`train_cell`."""
    plan = replace(context.plan, recipe=task.recipe)
    return train_cell(SweepContext(plan, context.data), CellTask(cell=task.cell, checkpoint=task.checkpoint))


def run_search(
    plan: SearchPlan,
    folder: Path,
    *,
    proposals: int,
    workers: int,
    engine: Engine = LOCAL,
    data: Sequence[GraspInputs] | None = None,
    on_cell: Callable[[ProposalTask, CellResult | None], None] | None = None,
) -> None:
    """Judge proposals until there are so many, other than those in the hands of other processes.

    A proposal of which a trial cannot be trained has failed, and stops no other. With one worker, proposals follow from
    the plan alone; of several, the one that is proposed next depends on which ended first.

    Args:
        plan: As the folder has it.
        folder: Of the search.
        proposals: How many there are to be in all, those of other calls included.
        workers: Number of processes.
        engine: Where they run; those of this machine keep checkpoints in the folder.
        data: As :func:`~handsight.training.sweep.run.run_sweep` has it.
        on_cell: Called with each trial of a proposal and its result, or None where it failed.

    Raises:
        MissingExtraError: Optuna is not installed.
        SweepFolderError: The journal, or what is kept of a cell, is damaged.
        OSError: The disk is full or not writable.
        WorkerDiedError: Workers cannot be started.
    """
    # Workers elsewhere may not see the folder: what they have of a cell is lost with them.
    keeps = engine is LOCAL
    judges = _Judges(plan, folder, SearchStudy(folder, plan), proposals, keeps=keeps)
    opener = SweepContextFactory(plan.sweep, tuple(data) if data and keeps else None)
    outcomes = map_unordered(opener, train_proposal, judges.tasks(), workers=workers, engine=engine, noun="proposal")
    try:
        for task, outcome in outcomes:
            judged = judges.active[task.proposal]
            with naming(task.cell):
                result = kept_result(judged.folder, task.cell, outcome)
            judges.take(judged, task.cell.trial, result)
            if on_cell is not None:
                on_cell(task, result)
    finally:
        outcomes.close()
        for judged in judges.active.values():
            judged.lock.release()


class _Judges:
    """Hands out trials of proposals, and takes what became of them."""

    def __init__(self, plan: SearchPlan, folder: Path, study: SearchStudy, most: int, *, keeps: bool) -> None:
        self._keeps = keeps
        self._plan, self._folder, self._study, self._most = plan, folder, study, most
        self._cells = list(plan.sweep.cells())
        self.active: dict[int, _Judged] = {}

    def tasks(self) -> Iterator[ProposalTask]:
        """Trials, each when a worker is free for it."""
        while (found := self._next()) is not None:
            judged, trial = found
            judged.in_hand.add(trial)
            cell = self._cells[trial]
            settings = cell.settings(judged.recipe, self._plan.sweep.training_seed(trial))
            judged.folder.cell_folder(cell).mkdir(parents=True, exist_ok=True)
            judged.folder.write_config(cell, {"settings": asdict(settings), "handsight": __version__})
            yield ProposalTask(
                proposal=judged.proposal.number,
                recipe=judged.recipe,
                cell=cell,
                checkpoint=judged.folder.checkpoint(cell).absolute() if self._keeps else None,
            )

    def take(self, judged: _Judged, trial: int, result: CellResult | None) -> None:
        """See what a trial means for its proposal; None where it failed."""
        judged.in_hand.discard(trial)
        if result is not None:
            judged.results[trial] = result
        if not judged.over:
            if result is None:
                self._study.finish(judged.proposal.number, "failed")
                judged.over = True
            else:
                self._judge(judged)
        self._let_go(judged)

    def _next(self) -> tuple[_Judged, int] | None:
        """The trial to train now."""
        # One trial of a proposal after the other, because after each it may be given up.
        for judged in self.active.values():
            if not judged.in_hand and (trial := self._left(judged)) is not None:
                return judged, trial
        while (claimed := self._study.claim(self._most)) is not None:
            judged = self._begun(*claimed)
            if (trial := self._left(judged)) is not None:
                return judged, trial
        # Nothing else is left to do: those that are begun share the workers.
        for judged in self.active.values():
            if (trial := self._left(judged)) is not None:
                return judged, trial
        return None

    def _left(self, judged: _Judged) -> int | None:
        done = judged.results.keys() | judged.in_hand
        left = [cell.trial for cell in self._cells if cell.trial not in done]
        return left[0] if left and not judged.over else None

    def _begun(self, proposal: Proposal, lock: HeldFile) -> _Judged:
        """A proposal with what is kept of it."""
        recipe = recipe_at(proposal.values, self._plan.sweep.recipe)
        folder = proposal_folder(self._folder, proposal, recipe)
        judged = _Judged(proposal=proposal, recipe=recipe, folder=folder, lock=lock, results={})
        self.active[proposal.number] = judged
        for cell, result in folder.results(self._cells).items():
            folder.tidy(cell)
            judged.results[cell.trial] = result
        self._judge(judged)
        self._let_go(judged)
        return judged

    def _judge(self, judged: _Judged) -> None:
        """Report trials in their order, as far as there is no gap, and end the proposal if that is the end of it."""
        number = judged.proposal.number
        losses: list[float] = []
        while len(losses) in judged.results:
            losses.append(loss_of(judged.results[len(losses)]))
            self._study.report(number, len(losses) - 1, sum(losses) / len(losses))
        if len(losses) == len(self._cells):
            self._study.finish(number, "done", sum(losses) / len(losses))
            judged.over = True
        elif losses and number and self._study.is_hopeless(number):
            self._study.finish(number, "pruned")
            judged.over = True

    def _let_go(self, judged: _Judged) -> None:
        if judged.over and not judged.in_hand:
            del self.active[judged.proposal.number]
            judged.lock.release()


def proposal_folder(folder: Path, proposal: Proposal, recipe: TrainSettings) -> SweepFolder:
    """Where the cells of a proposal are kept: those of another recipe are never taken for its own."""
    settings = json.dumps(asdict(recipe), sort_keys=True)
    digest = hashlib.sha256(settings.encode()).hexdigest()[:8]
    return SweepFolder(folder / PROPOSALS / f"{proposal.number:04d}-{digest}")


def loss_of(result: CellResult) -> float:
    """Cross-entropy on what the trial held out."""
    return math.inf if result.tested.loss is None else result.tested.loss
