"""Why grasps fail, told from what any station measures (section VI-E).

What is known of a grasp: whether a phase stopped, at which height and force the descent ended, the jaws' opening after
each phase, and where somebody can tell, whether an object was held in truth. Beside the causes stands the phase in
which it happened: where the arm was blocked, where an object was lost, and what ended the trials that do not count; and
in simulation, which part of the hand landed on an object, and whether the object was pushed away.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final, TypedDict

from handsight.datasets.records import PHASES

if TYPE_CHECKING:
    from handsight.evaluation.trial import Trial

TABLE_CONTACT_M: Final = 0.008
"""Fingertips that stop lower than this above the table have reached it: the thinnest objects, pens, are as high."""
PUSHED_M: Final = 0.01
"""An object that has been moved by more than this was pushed away."""

MISREAD: Final = "held, read as closed"
BLOCKED: Final = "arm blocked"
ON_OBJECT_EMPTY: Final = "on an object, closed on nothing"
ON_OBJECT_LOST: Final = "on an object, gripped and lost"
AT_TABLE_EMPTY: Final = "at the table, closed on nothing"
AT_TABLE_LOST: Final = "at the table, gripped and lost"
CAUSES: Final = {
    MISREAD: "an object is held in truth, yet the gripper reads as closed: a fault of the label",
    BLOCKED: "a phase from the descent on did not complete: the arm was stopped",
    ON_OBJECT_EMPTY: "the descent ended on an object, and the jaws met",
    ON_OBJECT_LOST: "the descent ended on an object, the jaws held something, and lost it in the lift or the shakes",
    AT_TABLE_EMPTY: "the descent reached the table, and the jaws met: nothing was between them",
    AT_TABLE_LOST: "the descent reached the table, the jaws held something, and lost it in the lift or the shakes",
}
"""Every cause with what it means, in the order in which they are asked for; the first that fits is taken."""


class CausesRow(TypedDict):
    """The failures of a method on an object set, by cause."""

    method: str
    objects: str
    trials: int
    """Trials that count."""
    failures: int
    causes: dict[str, int]
    """Failures of each of ``CAUSES``; they add up to ``failures``."""
    unsure: int
    """Failures whose score at the grasp was below the threshold: no better pose was found within the limit of moves."""
    landed_with: dict[str, int]
    """Failures on an object, by the part of the robot that landed on it, as far as it is known."""
    pushed_away: int
    """Failures in which the jaws closed on nothing and the object had been moved by more than ``PUSHED_M``, as far as
    that is known: fingers that come down beside an object, or on it, push it from between them."""
    blocked_in: dict[str, int]
    """Failures for a blocked arm, by the phase that did not complete."""
    lost_in: dict[str, int]
    """Objects gripped and lost, by whether the lift or the shakes lost them; one held after both is in neither."""
    aborted_in: dict[str, int]
    """Trials that do not count, by what ended them: ``settle`` for a scene that did not come to rest, ``reach`` for a
    start out of reach, ``look`` for the camera, and ``inputs`` for pictures without depth and scores that are none."""


def cause_of(trial: Trial, closed_width_m: float) -> str | None:
    """Why a trial failed; None for a success and for an aborted trial.

    Args:
        trial: The trial.
        closed_width_m: Openings at or below this count as closed [m]; see ``StationSpec``.
    """
    if trial.success or trial.aborted:
        return None
    if trial.failure or trial.closed_m is None:
        return BLOCKED
    if trial.truth_held:
        return MISREAD
    empty = trial.closed_m <= closed_width_m
    if _on_object(trial):
        return ON_OBJECT_EMPTY if empty else ON_OBJECT_LOST
    return AT_TABLE_EMPTY if empty else AT_TABLE_LOST


def causes_rows(
    trials: Iterable[Trial], *, objects: str, methods: Sequence[str], closed_width_m: float, threshold: float
) -> list[CausesRow]:
    """One row for each method, in the order given.

    Args:
        trials: Of one object set.
        objects: The set.
        methods: What was evaluated.
        closed_width_m: Openings at or below this count as closed [m].
        threshold: Predicted success above which a grasp is executed at once.
    """
    everything = list(trials)
    return [
        _row([trial for trial in everything if trial.method == name], name, objects, closed_width_m, threshold)
        for name in methods
    ]


def _on_object(trial: Trial) -> bool:
    touched = trial.contact_force_n is not None and trial.contact_force_n > 0
    return touched and trial.contact_height_m is not None and trial.contact_height_m > TABLE_CONTACT_M


def _row(everything: list[Trial], method: str, objects: str, closed_width_m: float, threshold: float) -> CausesRow:
    trials = [trial for trial in everything if not trial.aborted]
    causes = [cause_of(trial, closed_width_m) for trial in trials]
    told = list(zip(trials, causes, strict=True))
    lost = [trial for trial, cause in told if cause in (ON_OBJECT_LOST, AT_TABLE_LOST)]
    failures = [trial for trial in trials if not trial.success]
    return CausesRow(
        method=method,
        objects=objects,
        trials=len(trials),
        failures=len(failures),
        causes={name: causes.count(name) for name in CAUSES},
        unsure=sum(trial.score is not None and trial.score < threshold for trial in failures),
        landed_with=_tally(
            trial.touched_by for trial, cause in told if cause in (ON_OBJECT_EMPTY, ON_OBJECT_LOST) and trial.touched_by
        ),
        pushed_away=sum(
            trial.pushed_m is not None and trial.pushed_m > PUSHED_M
            for trial, cause in told
            if cause in (ON_OBJECT_EMPTY, AT_TABLE_EMPTY)
        ),
        blocked_in=_tally(_phase(trial) for trial, cause in told if cause == BLOCKED),
        lost_in=_tally(where for trial in lost if (where := _lost_in(trial, closed_width_m))),
        aborted_in=_tally(_phase(trial) for trial in everything if trial.aborted),
    )


def _phase(trial: Trial) -> str:
    """The phase that did not complete; errors of phases begin with its name, those of pictures and scores do not."""
    phase = trial.failure.partition(":")[0]
    return phase if phase in PHASES else "inputs"


def _lost_in(trial: Trial, closed_width_m: float) -> str | None:
    if trial.lifted_m is not None and trial.lifted_m <= closed_width_m:
        return "lift"
    return "shakes" if trial.final_m is not None and trial.final_m <= closed_width_m else None


def _tally(names: Iterable[str]) -> dict[str, int]:
    """How often each occurs, the most frequent first."""
    return dict(Counter(names).most_common())
