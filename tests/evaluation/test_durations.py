from __future__ import annotations

from tests.support.trials import make_trial

from handsight.evaluation.durations import duration_rows
from handsight.servoing.methods.registry import METHODS


def test_every_number_of_moves_has_a_row_and_the_last_is_the_limit() -> None:
    limit = METHODS["cem-1"].max_steps
    trials = [
        make_trial(0, moves=0),
        make_trial(1, moves=2),
        make_trial(2, moves=2, success=False),
        make_trial(3, moves=limit, success=False),
        make_trial(4, moves=0, success=False, aborted=True, failure="look: lost"),
        make_trial(5, "first-order", moves=2),
    ]
    rows = duration_rows(trials, objects="blocks-test", methods=("cem-1",))
    assert [row["moves"] for row in rows] == list(range(limit + 1))
    assert [row["limit"] for row in rows] == [False] * limit + [True]
    assert {row["moves"]: (row["trials"], row["successes"]) for row in rows if row["trials"]} == {
        0: (1, 1),
        2: (2, 1),
        limit: (1, 0),
    }


def test_methods_that_do_not_servo_have_no_durations() -> None:
    assert duration_rows([make_trial(method="random")], objects="o", methods=("random",)) == []
