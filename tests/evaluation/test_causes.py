from __future__ import annotations

from typing import Any

import pytest
from tests.support.trials import make_trial

from handsight.evaluation import causes
from handsight.evaluation.causes import CAUSES, cause_of, causes_rows
from handsight.evaluation.trial import Trial

CLOSED_M = 0.002


def failed(number: int = 0, *, at_m: float = 0.005, force_n: float = 0.0, closed_m: float = 0.0, **more: Any) -> Trial:
    grasp = {"contact_height_m": at_m, "contact_force_n": force_n, "closed_m": closed_m, "final_m": 0.0}
    return make_trial(number, success=False, **{**grasp, **more})


CASES = {
    causes.MISREAD: failed(truth_held=True),
    causes.BLOCKED: failed(failure="lift: the arm is blocked", closed_m=0.02, truth_held=None),
    causes.ON_OBJECT_EMPTY: failed(at_m=0.05, force_n=12),
    causes.ON_OBJECT_LOST: failed(at_m=0.05, force_n=12, closed_m=0.02),
    causes.AT_TABLE_EMPTY: failed(),
    causes.AT_TABLE_LOST: failed(closed_m=0.02),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_each_cause_is_told_from_what_was_measured(cause: str) -> None:
    assert cause_of(CASES[cause], CLOSED_M) == cause


def test_a_touch_at_table_height_is_the_table_and_not_an_object() -> None:
    assert cause_of(failed(at_m=0.006, force_n=40), CLOSED_M) == causes.AT_TABLE_EMPTY


def test_a_descent_that_was_stopped_is_blocked() -> None:
    stopped = make_trial(success=False, failure="descend: the arm is blocked", truth_held=None)
    assert cause_of(stopped, CLOSED_M) == causes.BLOCKED


def test_successes_and_aborted_trials_have_no_cause() -> None:
    assert cause_of(make_trial(), CLOSED_M) is None
    assert cause_of(make_trial(success=False, aborted=True, failure="look: lost"), CLOSED_M) is None


def test_causes_add_up_to_the_failures() -> None:
    trials = [
        make_trial(0),
        failed(1, score=0.5),
        failed(2, score=0.97, closed_m=0.02),
        make_trial(3, success=False, aborted=True, failure="look: lost"),
        make_trial(4, "random"),
    ]
    (row,) = causes_rows(trials, objects="o", methods=("cem-1",), closed_width_m=CLOSED_M, threshold=0.95)
    assert (row["trials"], row["failures"], row["unsure"]) == (3, 2, 1)
    assert list(row["causes"]) == list(CAUSES)
    assert sum(row["causes"].values()) == row["failures"]
    assert row["causes"][causes.AT_TABLE_LOST] == row["causes"][causes.AT_TABLE_EMPTY] == 1


def test_what_landed_on_the_object_and_whether_it_was_pushed_away_are_told_where_they_are_known() -> None:
    on_object = {"at_m": 0.05, "force_n": 12}
    trials = [
        failed(0, **on_object, touched_by="finger", pushed_m=0.03),
        failed(1, **on_object, touched_by="finger", pushed_m=0.001),
        failed(2, **on_object, touched_by="palm", closed_m=0.02, pushed_m=0.05),  # Gripped and lost, not pushed away.
        failed(3, **on_object),  # Of a station that does not know.
        failed(4, touched_by="finger", pushed_m=0.011),
        failed(5, touched_by="finger", truth_held=True, pushed_m=0.3),
        make_trial(6, touched_by="palm", pushed_m=0.2),
    ]
    (row,) = causes_rows(trials, objects="o", methods=("cem-1",), closed_width_m=CLOSED_M, threshold=0.95)
    assert row["landed_with"] == {"finger": 2, "palm": 1}
    assert row["pushed_away"] == 2


def test_where_it_happened_is_told_beside_the_cause() -> None:
    trials = [
        make_trial(0, success=False, failure="descend: the arm was blocked"),
        failed(1, failure="lift: the arm was blocked", closed_m=0.02),
        failed(2, failure="lift: the arm was blocked", closed_m=0.02),
        failed(3, closed_m=0.02, lifted_m=0.001),
        failed(4, closed_m=0.02, lifted_m=0.02, at_m=0.05, force_n=12),
        make_trial(5, success=False, aborted=True, failure="settle: objects still moved after 5 s"),
        make_trial(6, success=False, aborted=True, failure="reach: out of reach"),
        make_trial(7, success=False, aborted=True, failure="3 of 4 scores are not in [0, 1]"),
        make_trial(8),
    ]
    (row,) = causes_rows(trials, objects="o", methods=("cem-1",), closed_width_m=CLOSED_M, threshold=0.95)
    assert row["blocked_in"] == {"lift": 2, "descend": 1}
    assert row["lost_in"] == {"lift": 1, "shakes": 1}
    assert row["aborted_in"] == {"settle": 1, "reach": 1, "inputs": 1}
    assert sum(row["blocked_in"].values()) == row["causes"][causes.BLOCKED]
