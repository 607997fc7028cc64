"""What an attempt says of itself, and how messages count attempts."""

from __future__ import annotations

import pytest
from tests.support.factories import make_attempt, make_header

from handsight.datasets import Outcome
from handsight.datasets.errors import counted


@pytest.mark.parametrize(
    ("outcome", "labelled", "success"),
    [
        (Outcome.EMPTY, True, False),
        (Outcome.HELD, True, True),
        (Outcome.UNREACHABLE, False, False),
        (Outcome.ABORTED, False, False),
    ],
)
def test_only_a_labelled_attempt_that_held_is_a_success(outcome: Outcome, labelled: bool, success: bool) -> None:
    attempt = make_attempt(make_header(), 0, outcome=outcome)
    assert (attempt.labelled, attempt.success) == (labelled, success)


def test_one_is_singular() -> None:
    assert [counted(number, "attempt") for number in (0, 1, 2)] == ["0 attempts", "1 attempt", "2 attempts"]
