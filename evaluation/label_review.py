"""What a review of labels needs before the first network is trained, and what to do about its issues."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.curation.folds import UNKNOWN_GROUP, assign_folds, attempt_groups, read_folds
from handsight.datasets.errors import DatasetError, counted
from handsight.datasets.inputs.materialize import usable_attempts
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import matches
from handsight.evaluation.errors import EvaluationError, EvaluationSettingsError, LabelIssuesError
from handsight.evaluation.label_issues import LabelIssue
from handsight.training.cross_validation import check_folds
from handsight.training.errors import TrainingError
from handsight.training.settings import TrainSettings

FOLDS = 3
"""Folds made when no stored ones are named: with more, each network sees a little more and all take longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReviewPlan:
    """Everything that was asked for, checked before the first network is trained."""

    settings: TrainSettings
    fold_of_attempt: NDArray[np.integer[Any]]
    """Shape (N,)."""
    listed: NDArray[np.bool_]
    """Which attempts may be listed. Shape (N,)."""


def plan_review(dataset: GraspDataset, *, folds: str, epochs: int, where: str, seed: int) -> ReviewPlan:
    """Check what was asked for against the version; reads no picture and writes nothing.

    Args:
        dataset: The version to review.
        folds: Name of stored folds; empty for ``FOLDS`` that are made and not stored.
        epochs: Passes over the data for each network.
        where: Which attempts may be listed, as an expression; empty for all.
        seed: Of the networks, and of the folds where none are named.

    Raises:
        NoTrainingDataError: The version holds no labelled attempt.
        LabelIssuesError: Some of it makes no sense here; every fault is in the message.
    """
    attempts = usable_attempts(dataset, DEFAULT_VIEWPOINT)
    faults: list[str] = []
    with collect_faults(faults):
        settings = TrainSettings(epochs=epochs, seed=seed)
    with collect_faults(faults):
        listed = _listed(attempts, where)
    with collect_faults(faults):
        fold_of_attempt = _folds(dataset, attempts, folds, seed)
    if faults:
        raise LabelIssuesError("; ".join(faults))
    return ReviewPlan(settings=settings, fold_of_attempt=fold_of_attempt, listed=listed)


@contextmanager
def collect_faults(
    faults: list[str], expected: tuple[type[Exception], ...] = (DatasetError, EvaluationError, TrainingError)
) -> Iterator[None]:
    """Add what is wrong to a list and go on, so that all of it is reported at once."""
    try:
        yield
    except expected as error:
        faults.append(str(error))


def _listed(attempts: pd.DataFrame, where: str) -> NDArray[np.bool_]:
    listed = matches(attempts, where).to_numpy(dtype=bool) if where else np.ones(len(attempts), bool)
    if not listed.any():
        what = counted(len(attempts), "labelled attempt")
        raise LabelIssuesError(f"--where {where!r} holds for none of {what}: loosen it")
    return listed


def _folds(dataset: GraspDataset, attempts: pd.DataFrame, name: str, seed: int) -> NDArray[np.integer[Any]]:
    """The stored folds of that name, or folds for this review alone where none is given."""
    folds = (
        read_folds(dataset, name).fold[attempts.index].to_numpy()
        if name
        else review_folds(attempts, count=FOLDS, seed=seed)
    )
    check_folds(attempts["success"].to_numpy(dtype=np.float32), folds)
    return folds


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
            f"found {counted(successes, 'success', 'successes')} and {counted(failures, 'failure')}, expected at "
            f"least {count} of each, one for every fold: collect more attempts"
        )
    scenes = attempt_groups(attempts, "scene")
    own = pd.Series(attempts.index, index=attempts.index)
    groups: pd.Series[Any] = scenes.where(scenes != UNKNOWN_GROUP, own)
    if groups.nunique() < count:
        groups = own
    return assign_folds(groups, labels, count, np.random.default_rng(seed)).to_numpy()


def curation_commands(dataset: GraspDataset, issue: LabelIssue) -> tuple[str, str]:
    """The commands that correct the label and that exclude the attempt, ready to paste into a shell."""
    address = shlex.quote(_curated_address(dataset))
    reason = shlex.quote(f"label issue: {issue.label}, S {issue.predicted_success:.2f}")
    call = "handsight dataset"
    return (
        f"{call} relabel {address} {issue.attempt} --to {issue.other_label} -m {reason}",
        f"{call} exclude {address} {issue.attempt} -m {reason}",
    )


def _curated_address(dataset: GraspDataset) -> str:
    """The branch on which to curate what this version holds: its own, or ``main`` where it is no branch."""
    path = str(dataset.repository.path)
    on_branch = dataset.ref != DEFAULT_REF and dataset.ref in dataset.repository.branches()
    return f"{path}@{dataset.ref}" if on_branch else path
