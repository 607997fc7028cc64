"""How many servo moves a method takes before it grasps, and what comes of it (section VI-D, figure 9)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TypedDict

from handsight.servoing.methods.registry import METHODS

if TYPE_CHECKING:
    from handsight.evaluation.trial import Trial


class DurationRow(TypedDict):
    """One bar of figure 9: the trials of a method that took so many moves."""

    method: str
    objects: str
    moves: int
    trials: int
    """Trials that count and took so many moves."""
    successes: int
    limit: bool
    """Whether it is the last bar: the method may move no more often, and grasps the best pose seen, good or not."""


def duration_rows(trials: Iterable[Trial], *, objects: str, methods: Sequence[str]) -> list[DurationRow]:
    """A row for every number of moves from 0 to the method's limit, empty ones included, for methods that servo."""
    counted = [trial for trial in trials if not trial.aborted]
    return [
        _row([trial for trial in counted if (trial.method, trial.moves) == (name, moves)], name, objects, moves)
        for name in methods
        if METHODS[name].settings is not None
        for moves in range(METHODS[name].max_steps + 1)
    ]


def _row(trials: list[Trial], method: str, objects: str, moves: int) -> DurationRow:
    return DurationRow(
        method=method,
        objects=objects,
        moves=moves,
        trials=len(trials),
        successes=sum(trial.success for trial in trials),
        limit=moves == METHODS[method].max_steps,
    )
