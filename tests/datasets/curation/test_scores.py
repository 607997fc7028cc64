"""Scores written back are columns like any other, and touch nothing that was recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.support.lab import make_lab

from handsight.datasets import (
    AttemptNotFoundError,
    Curator,
    GraspDataset,
    GraspRepository,
    RefNameError,
    Selection,
    UnknownNameError,
)
from handsight.datasets.curation.scores import forget_scores, save_scores
from handsight.datasets.reading.listing import Listing, list_attempts


@pytest.fixture
def repository(tmp_path: Path) -> GraspRepository:
    return make_lab(tmp_path / "lab")


def opened(repository: GraspRepository) -> GraspDataset:
    return GraspDataset.open(str(repository.path))


def draw(dataset: GraspDataset) -> pd.Series[float]:
    """A score for every attempt that carries a label, in single precision as it is stored."""
    ids = dataset.attempts.index[dataset.attempts["success"].notna()]
    values = np.random.default_rng(0).random(len(ids), dtype=np.float32).astype(np.float64)
    return pd.Series(values, index=ids)


def save(
    repository: GraspRepository, name: str, score: pd.Series[float], *, replace: bool = False, dry_run: bool = False
) -> None:
    source = "weights of a test"
    save_scores(repository, name, score, source=source, author="me", replace=replace, dry_run=dry_run)


def test_they_are_columns_of_the_table_of_its_parts_and_of_listings(repository: GraspRepository) -> None:
    before = opened(repository)
    score = draw(before)
    save(repository, "rgbd", score)
    after = opened(repository)
    table = after.attempts
    assert table.drop(columns=["score_rgbd", "error_rgbd"]).equals(before.attempts)
    pd.testing.assert_series_equal(table["score_rgbd"][score.index], score, check_names=False)
    assert table["score_rgbd"].drop(score.index).isna().all()
    error = (score - table["success"][score.index].astype("float64")).abs()
    pd.testing.assert_series_equal(table["error_rgbd"][score.index], error, check_names=False)
    assert table["error_rgbd"].drop(score.index).isna().all()
    ids = [str(key) for key in score.index[3:6]]
    assert after.rows(ids)["score_rgbd"].tolist() == score[ids].tolist()
    assert after.table("error_rgbd").columns.tolist() == ["error_rgbd"]
    assert after.tail(4, ("score_rgbd", "number")).columns.tolist() == ["score_rgbd", "number"]
    worst = list_attempts(after, Listing(where="score_rgbd >= 0", sort="error_rgbd", reverse=True, columns=()))
    assert worst.rows.index.tolist() == error.sort_values(ascending=False, kind="stable").index.tolist()


def test_errors_follow_the_label_that_counts(repository: GraspRepository) -> None:
    score = draw(opened(repository))
    save(repository, "rgbd", score)
    attempt = str(score.index[0])
    success = bool(opened(repository).attempts["success"][attempt])
    Curator(repository, author="me").relabel(Selection(ids=(attempt,)), not success, "seen")
    error = opened(repository).attempts["error_rgbd"][attempt]
    assert error == pytest.approx(abs(score[attempt] - (not success)))


def test_content_stays_what_it_was(repository: GraspRepository) -> None:
    before = opened(repository)
    save(repository, "rgbd", draw(before))
    after = opened(repository)
    assert (after.digest, after.curation_digest) == (before.digest, before.curation_digest)
    assert after.snapshot_id != before.snapshot_id
    assert "score_rgbd" not in GraspDataset.open(f"{repository.path}@v1").attempts


def test_names_are_refused_and_scores_replaced_or_forgotten(repository: GraspRepository) -> None:
    score = draw(opened(repository))
    for name in ("", "Rgbd", "1st", "a-b", "x" * 49):
        with pytest.raises(RefNameError, match="expected up to 48 small letters"):
            save(repository, name, score)
    save(repository, "rgbd", score)
    tip = opened(repository).snapshot_id
    with pytest.raises(RefNameError, match="replace them"):
        save(repository, "rgbd", score)
    stranger = pd.Series([0.5], index=["01M8D7AEHT2D4A36HWXR6AQSTZ-000000"])
    with pytest.raises(AttemptNotFoundError, match="01M8D7AEHT2D4A36HWXR6AQSTZ-000000 the first"):
        save(repository, "other", stranger)
    save(repository, "other", score, dry_run=True)
    forget_scores(repository, "rgbd", dry_run=True)
    with pytest.raises(UnknownNameError, match="scores: rgbd"):
        forget_scores(repository, "other")
    assert opened(repository).snapshot_id == tip
    save(repository, "rgbd", 1 - score, replace=True)
    assert opened(repository).attempts["score_rgbd"][score.index[0]] == pytest.approx(1 - score.iloc[0])
    forget_scores(repository, "rgbd")
    assert "score_rgbd" not in opened(repository).attempts
