"""The proposals of a search, as Optuna makes and keeps them; the only file that imports it.

Optuna is an extra: ``pip install 'handsight[tune]'``. Its journal, ``study.log``, holds one operation a line, so a
search that is killed loses nothing. What a proposal is follows from the seed, its number and the proposals before it:
each is drawn by a sampler of its own in a copy of the study, and enters the journal whole.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from handsight.datasets.held import HeldFile, lock_of, remove_abandoned
from handsight.training.errors import MissingExtraError, SweepFolderError
from handsight.training.search.plan import SPACE, SearchPlan, values_of

if TYPE_CHECKING:
    import optuna
    from optuna.distributions import BaseDistribution

INSTALL = "pip install 'handsight[tune]'"
STUDY = "study.log"
PROPOSALS = "proposals"
BEFORE_PRUNING = 5
"""Proposals that are judged by all of their trials before one is given up for being worse than half of them."""
_NAME = "handsight"

ProposalState = Literal["done", "pruned", "failed", "running", "left"]
_STATES: dict[str, ProposalState] = {
    "COMPLETE": "done",
    "PRUNED": "pruned",
    "FAIL": "failed",
    "RUNNING": "running",
    "WAITING": "left",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """A place in the space that is tried."""

    number: int
    """From 0, which is the recipe that the search began with."""
    values: dict[str, float]
    state: ProposalState
    """``running`` is what somebody has begun, be it a process that lives or one that does not."""
    losses: dict[int, float]
    """Mean loss over the trials up to each that has been judged."""


def check_optuna() -> None:
    """Refuse where Optuna is not installed, without importing it.

    Raises:
        MissingExtraError: It is not.
    """
    if find_spec("optuna") is None:
        raise MissingExtraError(f"a search needs Optuna, which is not installed: {INSTALL}")


class SearchStudy:
    """The journal of a folder.

    Args:
        folder: Of the search; it exists.
        plan: As the folder has it.

    Raises:
        MissingExtraError: Optuna is not installed.
        SweepFolderError: The journal is damaged.
    """

    def __init__(self, folder: Path, plan: SearchPlan) -> None:
        check_optuna()
        import optuna  # an extra
        from optuna.storages.journal import JournalFileBackend

        # It would write a line for every proposal to standard error, through a progress bar.
        optuna.logging.set_verbosity(optuna.logging.CRITICAL)
        self._folder, self._plan = folder, plan
        path = folder / STUDY
        self._lock = _JournalLock(path)
        with self._lock, _reading(path):
            # The base class of locks is private.
            backend = JournalFileBackend(str(path), lock_obj=self._lock)  # type: ignore[arg-type]
            storage = optuna.storages.JournalStorage(backend)
            pruner = optuna.pruners.MedianPruner(n_startup_trials=BEFORE_PRUNING)
            # Asked first: to create what is there would be written down as well.
            is_there = _NAME in optuna.study.get_all_study_names(storage)
            begin = optuna.load_study if is_there else optuna.create_study
            self._study = begin(study_name=_NAME, storage=storage, pruner=pruner)

    def proposals(self) -> list[Proposal]:
        """All that there are, by number."""
        return [_proposal(trial) for trial in self._trials()]

    def claim(self, most: int) -> tuple[Proposal, HeldFile] | None:
        """Take a proposal that was begun and is in nobody's hands, or else a new one.

        Args:
            most: Proposals that there may be in all.

        Returns:
            The proposal, and a file that is held for as long as it is in these hands; None where there is none to take.
        """
        with self._lock:
            trials = self._trials()
            for trial in trials:
                if _STATES[trial.state.name] == "running" and (held := self._held(trial.number)) is not None:
                    # A process that was killed between two lines has left the rest of its parameters to be said.
                    self._study_trial(trial.number, finish_params=True)
                    return self._proposal(trial.number), held
                if trial.state.is_finished() and self._lock_path(trial.number).exists():
                    remove_abandoned(self._lock_path(trial.number))  # of a process that was killed just after
            if not any(_STATES[trial.state.name] == "left" for trial in trials):
                if len(trials) >= most:
                    return None
                self._study.enqueue_trial(self._next(trials))
            number = self._study.ask(_distributions()).number
            held = self._held(number)
            if held is None:
                raise SweepFolderError(
                    f"{self._lock_path(number)} is held by somebody, and {STUDY} does not know of it: begin in a new "
                    "folder"
                )
            return self._proposal(number), held

    def report(self, number: int, step: int, mean: float) -> None:
        """Keep the mean loss over the trials up to one; what has been said before stays."""
        if step not in self._proposal(number).losses:
            self._study_trial(number).report(mean, step)

    def is_hopeless(self, number: int) -> bool:
        """Whether a proposal is worse so far than half of those that are done, by what was reported last."""
        return self._study_trial(number).should_prune()

    def finish(self, number: int, state: Literal["done", "pruned", "failed"], loss: float | None = None) -> None:
        """Say what became of a proposal; ``loss`` where it is done."""
        import optuna

        names = {state: name for name, state in _STATES.items()}
        self._study.tell(number, loss, state=optuna.trial.TrialState[names[state]])

    def _next(self, trials: list[optuna.trial.FrozenTrial]) -> dict[str, float]:
        """The values of the proposal after some others."""
        import optuna

        recipe = self._plan.sweep.recipe
        if not trials:
            return values_of(recipe)
        seed = np.random.SeedSequence([self._plan.sweep.seed, len(trials), 2]).generate_state(1)[0]
        # A sampler of its own for each: one that goes on would begin anew with every call.
        copy = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=int(seed)))
        copy.add_trials(trials)
        return dict(copy.ask(_distributions()).params)

    def _trials(self) -> list[optuna.trial.FrozenTrial]:
        with _reading(self._folder / STUDY):
            return self._study.get_trials(deepcopy=False)

    def _proposal(self, number: int) -> Proposal:
        return _proposal(self._trials()[number])

    def _study_trial(self, number: int, *, finish_params: bool = False) -> optuna.trial.Trial:
        """A trial that is running, as ``ask`` gave it; perhaps to a process that is gone."""
        import optuna

        trial = optuna.trial.Trial(self._study, self._trials()[number]._trial_id)
        if finish_params:
            for name, dimension in SPACE.items():
                if dimension.whole:
                    trial.suggest_int(name, int(dimension.low), int(dimension.high), log=dimension.log)
                else:
                    trial.suggest_float(name, dimension.low, dimension.high, log=dimension.log)
        return trial

    def _lock_path(self, number: int) -> Path:
        return lock_of(self._folder / PROPOSALS / f"{number:04d}")

    def _held(self, number: int) -> HeldFile | None:
        lock = self._lock_path(number)
        lock.parent.mkdir(exist_ok=True)
        if lock.exists() and not remove_abandoned(lock):
            return None
        try:
            return HeldFile(lock)
        except FileExistsError:
            return None


class _JournalLock:
    """Held over everything that is written to a journal; the kernel lets go of it when the process ends.

    What Optuna has for it goes by the age of a file, and does not mend a line that was being written when the power
    went: every line after it would be lost.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor = -1
        self._depth = 0

    def acquire(self) -> bool:
        """Wait until nobody else has it; may be called again by who has it."""
        if not self._depth:
            self._descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                fcntl.flock(self._descriptor, fcntl.LOCK_EX)
                self._mend()
            except BaseException:
                os.close(self._descriptor)
                raise
        self._depth += 1
        return True

    def release(self) -> None:
        """Let go of it, as often as it was acquired."""
        self._depth -= 1
        if not self._depth:
            os.close(self._descriptor)

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def _mend(self) -> None:
        """Take away a last line without an end."""
        size = os.fstat(self._descriptor).st_size
        if size and os.pread(self._descriptor, 1, size - 1) != b"\n":
            os.truncate(self._descriptor, os.pread(self._descriptor, size, 0).rfind(b"\n") + 1)


def _proposal(trial: optuna.trial.FrozenTrial) -> Proposal:
    values = trial.params or trial.system_attrs.get("fixed_params", {})
    return Proposal(
        number=trial.number,
        values=dict(values),
        state=_STATES[trial.state.name],
        losses=dict(trial.intermediate_values),
    )


def _distributions() -> dict[str, BaseDistribution]:
    from optuna.distributions import FloatDistribution, IntDistribution

    return {
        name: IntDistribution(int(one.low), int(one.high), log=one.log)
        if one.whole
        else FloatDistribution(one.low, one.high, log=one.log)
        for name, one in SPACE.items()
    }


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Say which file it is that Optuna cannot read."""
    try:
        yield
    except (ValueError, KeyError, TypeError, AssertionError) as error:
        raise SweepFolderError(
            f"{path} is damaged ({type(error).__name__}: {error}): restore it from a copy, or begin in a new folder"
        ) from error
