"""A part of a report names the call that evaluates the same."""

from __future__ import annotations

import shlex
from typing import Any

import pytest
from tests.support.reports import make_evaluation

from handsight.viz.report.content import Facts
from handsight.viz.report.evaluation_part import evaluation_command, evaluation_section

RESULTS: dict[str, Any] = {
    "rows": [{"method": "cem-1", "objects": "blocks-test", "trials": 3, "aborted": 1}],
    "model": "my runs/rgbd",
    "gripper": "2f-85",
    "threshold": 0.9,
    "seed": 5,
}
CALL = "handsight evaluate --model 'my runs/rgbd' --methods cem-1 --objects blocks-test --trials 4 --gripper 2f-85 "
CALL += "--threshold 0.9 --seed 5"


@pytest.mark.parametrize(
    ("said", "more"),
    [
        ({}, []),
        ({"level": False, "disturbance": None}, []),
        ({"level": True}, ["--level"]),
        ({"level": True, "disturbance": "hand-eye:5deg"}, ["--disturb", "hand-eye:5deg", "--level"]),
    ],
)
def test_the_call_has_all_that_decided_the_trials(said: dict[str, Any], more: list[str]) -> None:
    assert shlex.split(evaluation_command({**RESULTS, **said})) == [*shlex.split(CALL), *more]


@pytest.mark.parametrize(
    ("told", "levelled", "disturbed"),
    [
        ({"level": True, "disturbance": "hand-eye:5deg"}, "yes", "hand-eye:5deg"),
        ({"level": False, "disturbance": None}, "no", "–"),
        ({}, "–", "–"),
    ],
    ids=["levelled", "plain", "older"],
)
def test_the_facts_say_under_what_conditions_trials_ran(told: dict[str, Any], levelled: str, disturbed: str) -> None:
    (facts,) = evaluation_section({**make_evaluation(), **told}, title="results").blocks
    assert isinstance(facts, Facts)
    rows = dict(facts.rows)
    assert (rows["views levelled"], rows["disturbance"]) == (levelled, disturbed)
