"""Scores as they are stored: read back as they were written, and refused where they cannot be scores."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import zarr

from handsight.datasets import CorruptDataError
from handsight.datasets.format.scores import (
    ScoreOrigin,
    StoredScores,
    read_scores,
    score_columns,
    score_names,
    write_scores,
)

ORIGIN = ScoreOrigin(source="weights", author="me", made="2026-03-01T12:00:00Z")
IDS = [f"01M8D7AEHT2D4A36HWXR6AQSTZ-{number:06d}" for number in (0, 7, 123_456)]


def stored(*values: float) -> zarr.Group:
    root = zarr.group(store=zarr.storage.MemoryStore())
    score: pd.Series[float] = pd.Series(values, index=IDS[: len(values)], dtype="float64")
    write_scores(root, StoredScores(name="rgbd", origin=ORIGIN, score=score))
    return root


def test_what_is_read_is_what_was_written() -> None:
    root = stored(0.0, 0.25, 1.0)
    found = read_scores(root, "rgbd")
    assert found.origin == ORIGIN
    assert found.score.to_dict() == dict(zip(IDS, (0.0, 0.25, 1.0), strict=True))
    assert score_names(root) == ["rgbd"]
    assert score_columns(root) == ["score_rgbd", "error_rgbd"]
    assert score_names(zarr.group(store=zarr.storage.MemoryStore())) == []


@pytest.mark.parametrize("value", [float("nan"), -0.1, 1.5, float("inf")])
def test_a_score_that_is_none_is_damage(value: float) -> None:
    root = stored(0.5, 0.5)
    array = root["scores/rgbd/score"]
    assert isinstance(array, zarr.Array)
    array[1] = np.float32(value)
    with pytest.raises(CorruptDataError, match="expected 0 to 1"):
        read_scores(root, "rgbd")


def test_origins_that_are_none_are_damage() -> None:
    root = stored(0.5)
    group = root["scores/rgbd"]
    assert isinstance(group, zarr.Group)
    group.attrs["author"] = 3
    with pytest.raises(CorruptDataError, match="scores 'rgbd' are damaged"):
        read_scores(root, "rgbd")
