"""Which labels are likely to be wrong: label issues, found with cross-validated networks.

The quality of a label is the predicted probability of that label, by a network that never saw the attempt: the
self-confidence of confident learning (Northcutt et al., 2021), named as in cleanlab.

Scores are chances, and successes are rare, so most successes have a lower label quality than almost any failure.
Confident learning therefore holds each label against its own kind. How far is a matter of what went wrong: where every
label is wrong with the same chance, the quality gives the right order as it is; where as many successes as failures are
wrong, the odds have to be taken relative to the share of the label. That is not known, so a list is chosen half-way
between.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.errors import counted
from handsight.servoing.scores import check_scores
from handsight.training.metrics import Metrics, evaluate_scores

SHARE_OF_PRIOR = 0.5
"""How much of the log-odds between the labels is left out of account: 0 ranks by label quality alone, 1 as if successes
and failures were equally many. docs/datasets.md has what each of them finds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelIssue:
    """An attempt whose label may be wrong."""

    attempt: str
    success: bool
    """The label that counts: the recorded one, or the one a curator gave."""
    predicted_success: float
    """By a network that never saw the attempt, in [0, 1]."""
    label_quality: float
    """Predicted probability of the label, by the same network, in [0, 1]."""
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
    """The likeliest label issues, and how far to trust their ranking."""

    issues: tuple[LabelIssue, ...]
    """Lowest label quality first."""
    metrics: Metrics
    """Of the scores of all attempts, those that are not listed included."""

    @property
    def trust(self) -> str:
        """How good the networks are, in words."""
        attempts, accuracy, auc = self.metrics.attempts, self.metrics.accuracy, self.metrics.auc
        if accuracy is None or auc is None:
            return f"cross-validated on {counted(attempts, 'attempt')} of one label: the label quality says nothing"
        return (
            f"cross-validated on {counted(attempts, 'attempt')}: balanced accuracy {accuracy:.2f}, AUC {auc:.2f}; "
            "with an AUC of 0.5 this list would be chance"
        )


def label_quality(scores: NDArray[np.float32], labels: NDArray[np.float32]) -> NDArray[np.float64]:
    """Predicted probability of each given label. (N,), (N,) -> (N,)."""
    return 1 - _other_label(scores, labels).astype(np.float64)


def issue_log_odds(scores: NDArray[np.float32], labels: NDArray[np.float32]) -> NDArray[np.float64]:
    """Log-odds that each label is wrong, with ``SHARE_OF_PRIOR`` of what is due to rare labels taken out.

    (N,), (N,) -> (N,).
    """
    wrong = np.clip(_other_label(scores, labels).astype(np.float64), 1e-7, 1 - 1e-7)
    good = labels > 0.5
    # One is added to either, so that a label that nobody has makes no infinity.
    success_log_odds = math.log((good.sum() + 1) / ((~good).sum() + 1))
    prior: NDArray[np.float64] = np.where(good, success_log_odds, -success_log_odds)
    return np.log(wrong / (1 - wrong)) + SHARE_OF_PRIOR * prior


def rank_label_issues(
    attempts: pd.DataFrame, scores: NDArray[np.float32], *, count: int, listed: NDArray[np.bool_] | None = None
) -> LabelReview:
    """The attempts whose labels are likeliest to be wrong, lowest label quality first.

    Args:
        attempts: Rows of the attempts table, all of them labelled.
        scores: Predicted success of each, by a network that never saw it. Shape (N,).
        count: How many to list at most. They are chosen by :func:`issue_log_odds`.
        listed: Which may be listed; None for all. The metrics are those of all scores. Shape (N,).

    Raises:
        ScoreError: There is not one score for each attempt, or some are not in [0, 1].
    """
    check_scores(scores, len(attempts))
    labels = attempts["success"].to_numpy(dtype=np.float32)
    order = np.argsort(-issue_log_odds(scores, labels), kind="stable")
    if listed is not None:
        order = order[listed[order]]
    chosen = order[:count]
    # Not by the quality itself: close to 1 it is the same for labels that this tells apart.
    chosen = chosen[np.argsort(-_other_label(scores, labels)[chosen], kind="stable")]
    quality = label_quality(scores, labels)
    return LabelReview(
        issues=tuple(_label_issue(attempts.iloc[at], scores[at], quality[at]) for at in chosen),
        metrics=evaluate_scores(scores, labels),
    )


def _other_label(scores: NDArray[np.float32], labels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Predicted probability of the label that was not given. (N,), (N,) -> (N,)."""
    return np.where(labels > 0.5, 1 - scores, scores)


def _label_issue(row: pd.Series[Any], score: np.float32, quality: np.float64) -> LabelIssue:
    success = bool(row["success"])
    truth = None if pd.isna(row["truth_held"]) else bool(row["truth_held"])
    return LabelIssue(
        attempt=str(row.name),
        success=success,
        predicted_success=float(score),
        label_quality=float(quality),
        target=None if pd.isna(row["target"]) else str(row["target"]),
        truth_held=truth,
        truth_disagrees=None if truth is None else truth != success,
    )
