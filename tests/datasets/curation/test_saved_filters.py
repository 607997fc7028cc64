"""Saved filters are kept, checked and forgotten."""

from __future__ import annotations

import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.versions import opened

from handsight.datasets import (
    Curator,
    GraspRepository,
    Outcome,
    RefNameError,
    Selection,
    UnknownNameError,
    WhereError,
)
from handsight.datasets.curation.saved_filters import forget_filter, save_filter
from handsight.datasets.format.saved_filters import read_filters

HEADER = make_header()


@pytest.fixture
def curated(repository: GraspRepository) -> GraspRepository:
    """Attempts 0 to 5: held, empty, held, empty, held, aborted."""
    outcomes = [Outcome.HELD, Outcome.EMPTY] * 2 + [Outcome.HELD, Outcome.ABORTED]
    record(repository, HEADER, [make_attempt(HEADER, number, outcome=one) for number, one in enumerate(outcomes)])
    return repository


def numbers(repository: GraspRepository, column: str) -> list[int]:
    table = opened(repository).attempts
    return table["number"][table[column].fillna(False).astype(bool)].tolist()


def test_saved_filters_are_kept_checked_and_forgotten(curated: GraspRepository) -> None:
    assert save_filter(curated, "good", "success and not excluded", author="anna") == 3
    tip = curated.resolve("main")
    assert save_filter(curated, "good", "success and not excluded", author="ben") == 3
    assert curated.resolve("main") == tip
    with pytest.raises(RefNameError, match="there is a filter 'good' already"):
        save_filter(curated, "good", "success", author="anna")
    with pytest.raises(RefNameError, match="filter name is 'a b'"):
        save_filter(curated, "a b", "success", author="anna")
    with pytest.raises(WhereError, match="no column 'sucess'"):
        save_filter(curated, "typo", "sucess", author="anna")
    assert curated.resolve("main") == tip
    save_filter(curated, "good", "success", author="anna", replace=True)
    assert read_filters(curated.root(curated.resolve("main"))) == {"good": "success"}
    Curator(curated, author="anna").exclude(Selection(filter="good", where="number > 0"), "by filter")
    assert numbers(curated, "excluded") == [2, 4]
    forget_filter(curated, "good")
    assert read_filters(curated.root(curated.resolve("main"))) == {}
    assert read_filters(curated.root(tip)) == {"good": "success and not excluded"}
    with pytest.raises(UnknownNameError, match="no saved filter 'good'"):
        forget_filter(curated, "good")
