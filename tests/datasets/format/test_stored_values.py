"""Values that handsight never writes are found when they are read, and the attempt and the column are named."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.stored_columns import tamper

from handsight.datasets import CorruptDataError, GraspDataset, GraspRepository, Outcome, label_stats
from handsight.datasets.inputs.materialize import materialize
from handsight.servoing.homography import InputGrid

ENDED = (Outcome.EMPTY, Outcome.HELD, Outcome.ABORTED)


@pytest.fixture
def recorded(repository: GraspRepository) -> GraspRepository:
    """Six attempts of which four carry a label."""
    header = make_header(seed=3)
    record(repository, header, [make_attempt(header, number, outcome=ENDED[number % 3]) for number in range(6)])
    return repository


def opened(repository: GraspRepository) -> GraspDataset:
    return GraspDataset(repository, ref="main")


READERS: dict[str, Callable[[GraspDataset], object]] = {
    "table": lambda dataset: dataset.attempts,
    "info": lambda dataset: dataset.info(),
    "stats": label_stats,
    "attempts": lambda dataset: [dataset.attempt(one) for one in dataset.table().index],
    "inputs": lambda dataset: materialize(dataset, grid=InputGrid(crop_px=8, size_px=8)),
}


@pytest.mark.parametrize(
    ("column", "value", "read", "said"),
    [
        ("number", 7, "table", "number is 7, expected its place"),
        ("outcome", 4, "table", "outcome is 4, expected 0 to 3"),
        ("outcome", 255, "info", "outcome is 255, expected 0 to 3"),
        ("failure", 0xFF, "table", "failure is .*, expected text in UTF-8"),
        ("object_count", 99, "table", "object_count is 99, expected -1 to 3"),
        ("target", 30, "table", "target is 30, expected -1 to 2"),
        ("target", -7, "info", "target is -7, expected -1 to 2"),
        ("catalogue_index", 99, "table", r"catalogue_index is \[99, 99, 99\], expected -1 to 4"),
        ("truth_held", 5, "table", "truth_held is 5, expected -1 to 1"),
        ("started_elapsed_ns", np.iinfo(np.int64).min, "table", "started_elapsed_ns is .*, expected 0 to"),
        ("outcome", 4, "attempts", "outcome is 4, expected 0 to 3"),
        ("pregrasp_x_y_angle", np.nan, "inputs", "pregrasp_x_y_angle is .*nan.*, expected finite numbers"),
    ],
)
def test_a_value_that_no_attempt_has_is_named(
    recorded: GraspRepository, column: str, value: Any, read: str, said: str
) -> None:
    (session,) = opened(recorded).sessions
    tamper(recorded.folder, f"sessions/{session.ulid}/attempts/{column}", 1, np.asarray(value))
    with pytest.raises(CorruptDataError, match=rf"attempt {session.ulid}-000001: {said}"):
        READERS[read](opened(recorded))


@pytest.mark.parametrize("read", ["table", "info", "stats"])
def test_an_object_without_a_name_is_not_the_last_of_the_catalogue(recorded: GraspRepository, read: str) -> None:
    dataset = opened(recorded)
    (session,) = dataset.sessions
    number = int(np.flatnonzero(dataset.column(session.ulid, "target") >= 0)[0])
    tamper(recorded.folder, f"sessions/{session.ulid}/attempts/catalogue_index", number, np.asarray(-1))
    with pytest.raises(CorruptDataError, match=rf"{number}: catalogue_index is .*, expected an index for every object"):
        READERS[read](opened(recorded))


def test_a_pose_without_numbers_is_found_with_its_picture(recorded: GraspRepository) -> None:
    (session,) = opened(recorded).sessions
    tamper(recorded.folder, f"sessions/{session.ulid}/overhead/pose_base_tool", 1, np.asarray(np.inf))
    with pytest.raises(CorruptDataError, match=r"000001: overhead/pose_base_tool is .*, expected finite numbers"):
        opened(recorded).frame(f"{session.ulid}-000001")


@pytest.mark.parametrize("rows", [0, 5, 7])
def test_a_column_of_another_length_is_named(recorded: GraspRepository, rows: int) -> None:
    (session,) = opened(recorded).sessions
    tamper(recorded.folder, f"sessions/{session.ulid}/attempts/outcome", 0, rows=rows)
    with pytest.raises(CorruptDataError, match=rf"attempts/outcome is uint8 \({rows},\), expected uint8 \(6,\)"):
        READERS["table"](opened(recorded))
