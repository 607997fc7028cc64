from __future__ import annotations

import torch
from tests.support.scorers import FunctionScorer
from tests.support.scripted_station import ScriptedStation
from tests.support.trials import make_trial

from handsight.evaluation.one_look import loop_report
from handsight.evaluation.trial import Trial, run_trial
from handsight.servoing.loop import ServoSettings


def run(station: ScriptedStation, score: float) -> Trial:
    scorer = FunctionScorer(lambda inputs: torch.full((len(inputs),), score))
    return run_trial(station, scorer, "cem-1", 0, seed=1, settings=ServoSettings(), one_look=True)[0]


def test_one_look_is_one_step_and_no_return() -> None:
    station = ScriptedStation()
    trial = run(station, 0.5)
    assert (trial.moves, trial.score) == (1, 0.5)
    assert station.calls.count("look") == 2, "the overhead picture, and one while servoing"
    assert station.calls.count("reach") == 2
    assert trial.success


def test_a_start_that_is_good_is_grasped_and_a_step_out_of_reach_not_taken() -> None:
    sure = ScriptedStation()
    assert run(sure, 0.99).moves == 0
    assert sure.calls.count("reach") == 1
    kept = ScriptedStation(faults={"reach": 1})
    assert not run(kept, 0.5).aborted


def test_what_goes_wrong_before_the_descent_aborts() -> None:
    assert run(ScriptedStation(faults={"look": 1}), 0.5).aborted
    assert run(ScriptedStation(), float("nan")).aborted


def test_each_method_is_compared_with_itself() -> None:
    closed = {"o": [make_trial(0), make_trial(1), make_trial(2, success=False)]}
    one_look = {"o": [make_trial(0, success=False), make_trial(1), make_trial(2, success=False)]}
    report = loop_report(closed, one_look, methods=("cem-1",))
    (row,), (against,) = report["rows"], report["comparisons"]
    assert (row["method"], row["successes"], row["trials"]) == ("cem-1, one look", 1, 3)
    assert (against["method"], against["against"], against["won"], against["lost"]) == (
        "cem-1",
        "cem-1, one look",
        1,
        0,
    )
