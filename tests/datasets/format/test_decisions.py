"""Decisions that some other program wrote are found when they are read."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.stored_columns import tamper

from handsight.datasets import CorruptDataError, Curator, GraspDataset, GraspRepository, Outcome, Selection
from handsight.datasets.format.decisions import Action, check_value


@pytest.fixture
def curated(repository: GraspRepository) -> GraspRepository:
    header = make_header()
    record(repository, header, [make_attempt(header, number, outcome=Outcome.EMPTY) for number in range(4)])
    curator = Curator(repository, author="jo")
    curator.exclude(Selection(where="number == 1"), "dark")
    curator.relabel(Selection(where="success.notna()"), True, "it held")
    return repository


@pytest.mark.parametrize(
    ("array", "value", "said"),
    [
        ("decisions/facts", [7, -1, 0, 1], "7 is not a valid Action"),
        ("decisions/facts", [2, 9, 0, 1], "relabel has the value 9, expected 0 to 1"),
        ("decisions/facts", [4, 1, 0, 1], "undo has the value 1, expected 0 to 0"),
        ("decisions/facts", [0, -1, 2**63 - 1, 99], "its attempts end at 99 of"),
        ("decisions/facts", [0, -1, 2**63 - 1, 0], "its attempts end at 0 of"),
        ("decisions/reason", 0xFF, "'utf-8' codec can't decode"),
        ("decisions/author", 0xFF, "'utf-8' codec can't decode"),
    ],
)
def test_a_decision_that_nobody_takes_is_named(
    curated: GraspRepository, array: str, value: int | list[int], said: str
) -> None:
    tamper(curated.folder, f"curation/{array}", 1, np.asarray(value))
    with pytest.raises(CorruptDataError, match=rf"decision 1 of curation is damaged \(.*{said}.*open a version"):
        print(GraspDataset(curated, ref="main").overlay)


def test_decisions_without_reasons_are_damaged(curated: GraspRepository) -> None:
    tamper(curated.folder, "curation/decisions/reason", 0, rows=1)
    with pytest.raises(CorruptDataError, match="have columns of 2, 1 and 2, expected as many of each"):
        print(GraspDataset(curated, ref="main").overlay)


@pytest.mark.parametrize(
    ("action", "value"), [(Action.EXCLUDE, None), (Action.RELABEL, 0), (Action.RELABEL, 1), (Action.UNDO, 2)]
)
def test_values_that_decisions_have_are_sound(action: Action, value: int | None) -> None:
    check_value(action, value, 3)
