"""Cross-validated scores: nothing of an attempt's own fold reaches the network that judges it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from tests.support.drawn import SMALL, drawn_inputs

from handsight.datasets.inputs.materialize import GraspInputs
from handsight.training.course import Epoch
from handsight.training.cross_validation import check_folds, out_of_fold_scores
from handsight.training.errors import TrainingDataError
from handsight.training.metrics import Metrics, evaluate_scores
from handsight.training.prediction import predict_with_flips
from handsight.training.trainer import train

QUICK = replace(SMALL, epochs=1)
DATA = drawn_inputs(60, seed=0)
THIRDS: NDArray[np.int64] = np.arange(60) % 3


def relabelled(data: GraspInputs, changed: NDArray[np.bool_]) -> GraspInputs:
    """The same pictures with some labels turned round."""
    return replace(data, attempts=data.attempts.assign(success=data.attempts["success"] ^ changed))


@pytest.mark.parametrize("turned_round", [[0], [3, 7, 19], list(range(1, 20))], ids=["one", "some", "most"])
@pytest.mark.parametrize("fold", range(3))
def test_labels_never_reach_the_scores_of_their_own_fold(fold: int, turned_round: list[int]) -> None:
    own = np.equal(THIRDS, fold)
    turned = np.zeros(60, bool)
    turned[np.flatnonzero(own)[turned_round]] = True
    before = out_of_fold_scores(DATA, THIRDS, QUICK)
    after = out_of_fold_scores(relabelled(DATA, turned), THIRDS, QUICK)
    np.testing.assert_array_equal(after[own], before[own])
    # One of forty can be the same by chance.
    assert (after[~own] != before[~own]).mean() > 0.9


def test_a_picture_changes_no_other_score_of_its_fold() -> None:
    inputs = DATA.inputs.copy()
    inputs[4, 3] -= 0.05
    before = out_of_fold_scores(DATA, THIRDS, QUICK)
    after = out_of_fold_scores(replace(DATA, inputs=inputs), THIRDS, QUICK)
    same_fold = np.equal(THIRDS, THIRDS[4])
    np.testing.assert_array_equal(np.flatnonzero(same_fold & (after != before)), [4])
    assert (after[~same_fold] != before[~same_fold]).all()


def test_scores_are_those_of_a_network_that_never_held_the_fold() -> None:
    scores = out_of_fold_scores(DATA, THIRDS, QUICK)
    for fold in range(3):
        others = np.not_equal(THIRDS, fold)
        alone = GraspInputs(inputs=DATA.inputs[others], attempts=DATA.attempts[others])
        network = train(alone, replace(QUICK, holdout=0)).network
        expected = predict_with_flips(network, DATA.inputs, torch.from_numpy(np.flatnonzero(~others)))
        np.testing.assert_array_equal(scores[~others], expected)


@pytest.mark.parametrize("numbers", [[2, 0, 1], [-5, 2**40, 3]])
def test_only_the_division_counts_not_the_numbers_of_its_folds(numbers: list[int]) -> None:
    renamed = np.array(numbers)[THIRDS]
    np.testing.assert_array_equal(out_of_fold_scores(DATA, renamed, QUICK), out_of_fold_scores(DATA, THIRDS, QUICK))


def test_what_was_learnt_carries_over_to_the_folds_held_out() -> None:
    data = drawn_inputs(150, seed=3)
    scores = out_of_fold_scores(data, np.arange(150) % 3, SMALL)
    assert scores.dtype == np.float32
    assert (evaluate_scores(scores, data.labels).auc or 0) > 0.95


def test_progress_names_every_pass_and_every_fold() -> None:
    passes: list[Epoch] = []
    folds: list[tuple[int, Metrics]] = []
    scores = out_of_fold_scores(
        DATA,
        THIRDS + 5,
        replace(QUICK, epochs=2),
        on_fold=lambda fold, metrics: folds.append((fold, metrics)),
        on_epoch=passes.append,
    )
    assert [one.number for one in passes] == [1, 2] * 3
    held_out = [np.flatnonzero(np.equal(THIRDS, fold)) for fold in range(3)]
    assert folds == [(5 + k, evaluate_scores(scores[rows], DATA.labels[rows])) for k, rows in enumerate(held_out)]
    # Nothing but the fold is held out, whatever the settings say.
    assert all(one.held_out.attempts == 0 for one in passes)


def test_unsound_folds_are_refused_with_every_fault_before_anything_is_trained() -> None:
    passes: list[Epoch] = []
    labels = DATA.labels
    for bad in (THIRDS[:-1], THIRDS.astype(np.float64)):
        with pytest.raises(TrainingDataError, match="whole number for each of 60 attempts"):
            out_of_fold_scores(DATA, bad, QUICK, on_epoch=passes.append)  # type: ignore[arg-type]  # On purpose.
    with pytest.raises(TrainingDataError, match="1 fold given, expected at least 2"):
        out_of_fold_scores(DATA, np.zeros(60, np.int64), QUICK, on_epoch=passes.append)
    by_label = np.where(labels == 1, 0, 1 + np.arange(60) % 2)
    with pytest.raises(TrainingDataError) as caught:
        out_of_fold_scores(DATA, by_label, QUICK, on_epoch=passes.append)
    successes = int(labels.sum())
    for part in (f"fold 0 has {successes} successes in {successes} attempts", "fold 1 has 0 successes", "fold 2 has 0"):
        assert part in str(caught.value)
    with pytest.raises(TrainingDataError, match="and 55 more"):
        check_folds(labels, np.arange(60))
    with pytest.raises(TrainingDataError, match="0 folds given"):
        check_folds(labels[:0], THIRDS[:0])
    assert passes == []
