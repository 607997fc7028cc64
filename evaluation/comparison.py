"""Whether one method is better than another, from trials that both of them performed.

Trials of equal number begin alike, so that a scene which is easy for one method is easy for the other. What tells them
apart are the trials that one won and the other lost; McNemar's exact test (1947; binomial, two-sided) asks how often so
uneven a split would come by chance if the methods were equal. Trials that either of the two aborted are in no pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypedDict

from scipy import stats

from handsight.evaluation.errors import EvaluationSettingsError

if TYPE_CHECKING:
    from handsight.evaluation.trial import Trial


class ComparisonRow(TypedDict):
    """One method against the reference, on one object set."""

    method: str
    against: str
    """The reference."""
    objects: str
    pairs: int
    """Trials that count for both."""
    won: int
    """Pairs in which only the method succeeded."""
    lost: int
    """Pairs in which only the reference succeeded."""
    p: float
    """Two-sided; 1 where no pair tells the methods apart."""


def mcnemar_p(won: int, lost: int) -> float:
    """Probability of a split at least as uneven between two equal methods, two-sided, in (0, 1]."""
    if won + lost == 0:
        return 1.0
    return float(stats.binomtest(won, won + lost, 0.5).pvalue)


def check_reference(against: str | None, methods: Sequence[str]) -> None:
    """Refuse a reference that is not among the methods compared.

    Raises:
        EvaluationSettingsError: It is not.
    """
    if against is not None and against not in methods:
        raise EvaluationSettingsError(
            f"against is {against!r}, expected one of the methods that are compared: {', '.join(methods)}"
        )


def comparison_rows(
    trials: Sequence[Trial], *, objects: str, methods: Sequence[str], against: str | None = None
) -> list[ComparisonRow]:
    """Each method against a reference, in the order given.

    Args:
        trials: Of one object set.
        objects: The set.
        methods: What is compared.
        against: The reference; the method with the highest rate unless given, the first of equals. A reference that is
            the best of the same trials owes a part of its lead to luck: name one beforehand to test a claim.
    """
    results = {name: _results(trials, name) for name in methods}
    reference = max(methods, key=lambda name: _rate(results[name])) if against is None else against
    return [
        _row(results[name], results[reference], method=name, against=reference, objects=objects)
        for name in methods
        if name != reference
    ]


def _results(trials: Sequence[Trial], method: str) -> dict[int, bool]:
    """Whether each trial that counts succeeded, by its number."""
    return {trial.number: trial.success for trial in trials if trial.method == method and not trial.aborted}


def _rate(results: dict[int, bool]) -> float:
    return sum(results.values()) / len(results) if results else -1.0


def _row(ours: dict[int, bool], theirs: dict[int, bool], *, method: str, against: str, objects: str) -> ComparisonRow:
    pairs = [(ours[number], theirs[number]) for number in ours.keys() & theirs.keys()]
    won, lost = pairs.count((True, False)), pairs.count((False, True))
    return ComparisonRow(
        method=method,
        against=against,
        objects=objects,
        pairs=len(pairs),
        won=won,
        lost=lost,
        p=mcnemar_p(won, lost),
    )
