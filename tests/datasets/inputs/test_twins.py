"""Which attempts are one grasp recorded twice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.datasets.inputs.materialize import usable_attempts
from handsight.datasets.inputs.twins import grasp_keys


def test_attempts_of_one_seed_and_number_are_one_grasp() -> None:
    attempts = pd.DataFrame(
        {"seed": pd.array([0, 0, 0, 1, None, None], dtype="Int64"), "number": [3, 4, 3, 3, 3, 3]},
        index=pd.Index(["a-3", "a-4", "b-3", "c-3", "d-3", "e-3"], dtype="str"),
    )
    assert list(grasp_keys(attempts)) == ["0/3", "0/4", "0/3", "1/3", "d-3", "e-3"]
    assert list(grasp_keys(attempts.iloc[:0])) == []


def test_without_seeds_each_attempt_is_its_own() -> None:
    attempts = pd.DataFrame({"success": [True, False]}, index=pd.Index(["a", "b"], dtype="str"))
    assert list(grasp_keys(attempts)) == ["a", "b"]


def test_recorded_twins_have_one_key_and_others_none(tmp_path: Path) -> None:
    repository = GraspRepository.create(tmp_path / "grasps")
    for seed, noise in ((5, False), (5, True), (None, True)):
        header = replace(make_header(seed=seed, width=16, height=12), config={"noise": noise})
        outcomes = [make_attempt(header, number, outcome=Outcome.HELD) for number in range(3)]
        record(repository, header, outcomes)
    rows = usable_attempts(GraspDataset.open(str(repository.path)), "overhead")
    assert list(grasp_keys(rows)) == [*("5/0", "5/1", "5/2") * 2, *rows.index[6:]]
