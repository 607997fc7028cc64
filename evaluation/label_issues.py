"""Which labels cross-validated networks doubt.

The doubt of a label is 1 minus the predicted probability of that label, by a network that never saw the attempt: the
self-confidence of confident learning (Northcutt et al., 2021), turned round.

Scores are chances, and successes are rare, so networks doubt most successes more than almost any failure. Confident
learning therefore holds each label against its own kind. How far is a matter of what went wrong: where every label is
wrong with the same chance, the doubt is the right order as it is; where as many successes as failures are wrong, the
odds have to be taken relative to the share of the label. That is not known, so a list is chosen half-way between.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.curation.folds import UNKNOWN_GROUP, assign_folds, attempt_groups
from handsight.datasets.errors import counted
from handsight.evaluation.errors import EvaluationSettingsError, LabelIssuesError
from handsight.training.metrics import Metrics, evaluate_scores

SHARE_OF_PRIOR = 0.5
"""How much of the log odds between the labels is left out of account: 0 ranks by doubt alone, 1 as if successes and
failures were equally many. docs/datasets.md has what each of them finds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelIssue:
    """An attempt and how much its label is doubted."""

    attempt: str
    success: bool
    """The label that counts: the recorded one, or the one a curator gave."""
    predicted_success: float
    """By a network that never saw the attempt, in [0, 1]."""
    doubt: float
    """1 minus the predicted probability of the label, in [0, 1]."""
    target: str | None
    truth_held: bool | None
    """Simulator truth; None where there is none."""
    truth_disagrees: bool | None
    """Whether the simulator's truth speaks against the label; None where there is none."""

    @property
    def label(self) -> str:
        """The label as ``handsight dataset relabel --to`` names it."""
        return "success" if self.success else "failure"

    @property
    def other_label(self) -> str:
        """The label it would have if this one is wrong."""
        return "failure" if self.success else "success"

    @property
    def simulator(self) -> str:
        """What the simulator's truth says of the label, in a word."""
        return "-" if self.truth_disagrees is None else "disagrees" if self.truth_disagrees else "agrees"


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelReview:
    """The most doubted labels, and how far to trust the doubt."""

    suspects: tuple[LabelIssue, ...]
    """Most doubted first."""
    quality: Metrics
    """Of the scores of all attempts, those that are not listed included."""

    @property
    def trust(self) -> str:
        """How good the networks are that doubt, in words."""
        attempts, accuracy, auc = self.quality.attempts, self.quality.accuracy, self.quality.auc
        if accuracy is None or auc is None:
            return f"cross-validated on {counted(attempts, 'attempt')} of one label: the doubt says nothing"
        return (
            f"cross-validated on {counted(attempts, 'attempt')}: balanced accuracy {accuracy:.2f}, AUC {auc:.2f}; "
            "with an AUC of 0.5 this list would be chance"
        )


def review_folds(attempts: pd.DataFrame, *, count: int, seed: int) -> NDArray[np.integer[Any]]:
    """A fold for each labelled attempt, for a review that stores none: attempts of one scene stay together.

    Where the scene is not known, or there are fewer scenes than folds, each attempt stands for itself.

    Raises:
        EvaluationSettingsError: Fewer than two folds, or a negative seed.
        LabelIssuesError: There are not as many successes and failures as folds.
    """
    faults = [f"folds are {count}, expected at least 2"] if count < 2 else []
    faults += [f"seed is {seed}, expected 0 or more"] if seed < 0 else []
    if faults:
        raise EvaluationSettingsError("; ".join(faults))
    labels = attempts["success"].astype(bool)
    successes = int(labels.sum())
    failures = len(labels) - successes
    if min(successes, failures) < count:
        raise LabelIssuesError(
            f"there are {successes} successes and {failures} failures, expected at least {count} of each, one for "
            "every fold: collect more attempts"
        )
    scenes = attempt_groups(attempts, "scene")
    own = pd.Series(attempts.index, index=attempts.index)
    groups: pd.Series[Any] = scenes.where(scenes != UNKNOWN_GROUP, own)
    if groups.nunique() < count:
        groups = own
    return assign_folds(groups, labels, count, np.random.default_rng(seed)).to_numpy()


def label_doubt(scores: NDArray[np.float32], labels: NDArray[np.float32]) -> NDArray[np.float32]:
    """1 minus the predicted probability of each label. (N,), (N,) -> (N,)."""
    return np.where(labels > 0.5, 1 - scores, scores)


def issue_log_odds(scores: NDArray[np.float32], labels: NDArray[np.float32]) -> NDArray[np.float64]:
    """Logarithm of the odds that each label is wrong, with ``SHARE_OF_PRIOR`` of what is due to rare labels taken out.

    (N,), (N,) -> (N,).
    """
    doubt = np.clip(label_doubt(scores, labels).astype(np.float64), 1e-7, 1 - 1e-7)
    good = labels > 0.5
    # One is added to either, so that a label that nobody has makes no infinity.
    success_log_odds = math.log((good.sum() + 1) / ((~good).sum() + 1))
    prior: NDArray[np.float64] = np.where(good, success_log_odds, -success_log_odds)
    return np.log(doubt / (1 - doubt)) + SHARE_OF_PRIOR * prior


def rank_label_issues(
    attempts: pd.DataFrame, scores: NDArray[np.float32], *, count: int, listed: NDArray[np.bool_] | None = None
) -> LabelReview:
    """The attempts whose labels the networks speak against most, in the order of their doubt.

    Args:
        attempts: Rows of the attempts table, all of them labelled.
        scores: Predicted success of each, by a network that never saw it. Shape (N,).
        count: How many to list at most. They are chosen by :func:`issue_log_odds`.
        listed: Which may be listed; None for all. The quality of the scores is that of all. Shape (N,).
    """
    labels = attempts["success"].to_numpy(dtype=np.float32)
    order = np.argsort(-issue_log_odds(scores, labels), kind="stable")
    if listed is not None:
        order = order[listed[order]]
    chosen = order[:count]
    doubt = label_doubt(scores, labels)
    chosen = chosen[np.argsort(-doubt[chosen], kind="stable")]
    return LabelReview(
        suspects=tuple(_label_issue(attempts.iloc[at], scores[at], doubt[at]) for at in chosen),
        quality=evaluate_scores(scores, labels),
    )


def _label_issue(row: pd.Series[Any], score: np.float32, doubt: np.float32) -> LabelIssue:
    success = bool(row["success"])
    truth = None if pd.isna(row["truth_held"]) else bool(row["truth_held"])
    return LabelIssue(
        attempt=str(row.name),
        success=success,
        predicted_success=float(score),
        doubt=float(doubt),
        target=None if pd.isna(row["target"]) else str(row["target"]),
        truth_held=truth,
        truth_disagrees=None if truth is None else truth != success,
    )
