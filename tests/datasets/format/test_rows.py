"""Rows that nobody wrote with handsight make no attempt, and say so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.support.factories import difference, make_attempt, make_header

from handsight.datasets import Outcome, RecordError
from handsight.datasets.format.rows import from_row, to_row
from handsight.datasets.format.schema import Viewpoint, column_widths
from handsight.datasets.records import RgbdFrame

HEADER = make_header()
ATTEMPT = make_attempt(HEADER, 0, outcome=Outcome.HELD)
FRAMES: dict[Viewpoint, RgbdFrame | None] = {"overhead": ATTEMPT.overhead, "pregrasp": ATTEMPT.pregrasp}


def test_a_row_comes_back_as_the_attempt() -> None:
    row = to_row(ATTEMPT, widths=column_widths(HEADER))
    assert difference(from_row(row, FRAMES), ATTEMPT) is None


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("outcome", np.array(9, np.uint8), "row 0 makes no attempt: 9 is not a valid Outcome"),
        ("failure", np.full(512, 0xFF, np.uint8), "row 0 makes no attempt: 'utf-8' codec can't decode"),
    ],
)
def test_what_no_attempt_has_is_a_typed_error(column: str, value: np.ndarray[Any, Any], message: str) -> None:
    row = to_row(ATTEMPT, widths=column_widths(HEADER)) | {column: value}
    with pytest.raises(RecordError, match=message):
        from_row(row, FRAMES)
