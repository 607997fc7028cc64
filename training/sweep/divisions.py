"""How each trial of cross-validation divides a dataset (section VI-B, figure 7).

At the beginning of a trial groups of attempts are drawn, objects unless told otherwise, and held out. The test set is a
balanced draw from their attempts; the others, in a random order, are the pool. The training set of size n is the first
n of the pool, so that a larger one holds the smaller ones, and every channel set and recipe is tried on the same.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.curation.folds import Grouping, attempt_groups
from handsight.datasets.errors import counted
from handsight.training.errors import SweepPlanError

_FAULTS_LISTED = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Division:
    """What one trial learns from and is tested on; positions in the inputs of one dataset."""

    held_out: tuple[str, ...]
    """Groups that are held out, sorted."""
    test: NDArray[np.int64]
    """As many successes as failures of the groups held out, ascending. Shape (T,)."""
    pool: NDArray[np.int64]
    """The attempts of all other groups in the order in which they are trained on. Shape (P,)."""
    held_out_attempts: int
    """Attempts of the groups held out; the test set is drawn from these."""

    def trained_on(self, size: int | None) -> NDArray[np.int64]:
        """The training set of some size. Shape (size,)."""
        return self.pool[:size]

    def digest(self, attempts: pd.Index[str]) -> str:
        """Of the attempts by id, in order: equal where a trial is the same."""
        ids = [*attempts[self.test], "", *attempts[self.pool]]
        return hashlib.sha256("\n".join(ids).encode()).hexdigest()


def divide(
    rows: pd.DataFrame, groups: Sequence[str], *, by: Grouping, held_out: float, seed: int, trial: int
) -> Division:
    """The division of one trial; it depends on the arguments alone.

    Args:
        rows: Rows of the attempts table that inputs are made of.
        groups: Names of all groups, sorted; of several datasets, those of any, so that the same are held out.
        by: What a group is.
        held_out: Share of the groups to hold out, at least one and not all.
        seed: Of the sweep.
        trial: From 0.

    Returns:
        The division; its test set is empty where the groups held out lack successes or failures.
    """
    rng = np.random.default_rng([seed, trial])
    count = min(max(1, round(held_out * len(groups))), len(groups) - 1)
    chosen = sorted(groups[at] for at in rng.permutation(len(groups))[:count])
    is_out = attempt_groups(rows, by).isin(chosen).to_numpy()
    labels = rows["success"].to_numpy(dtype=bool)
    successes, failures = (np.flatnonzero(is_out & of_class) for of_class in (labels, ~labels))
    each = min(len(successes), len(failures))
    test = np.concatenate([rng.choice(part, each, replace=False) for part in (successes, failures)])
    return Division(
        held_out=tuple(chosen),
        test=np.sort(test),
        pool=rng.permutation(np.flatnonzero(~is_out)),
        held_out_attempts=int(is_out.sum()),
    )


def group_names(tables: Sequence[pd.DataFrame], by: Grouping) -> list[str]:
    """Names of the groups of some tables, sorted.

    Raises:
        SweepPlanError: There is one group, so none can be held out.
    """
    names = sorted(set().union(*(attempt_groups(rows, by).unique() for rows in tables)))
    if len(names) < 2:
        raise SweepPlanError(
            f"the attempts form {counted(len(names), 'group')} by {by}, expected at least 2 to hold one out: divide by "
            "something else, see --by, or collect more"
        )
    return names


def division_faults(
    divisions: Sequence[Division], labels: NDArray[np.float32], sizes: Sequence[int | None]
) -> list[str]:
    """What keeps trials from being trained and tested; empty when nothing does."""
    faults = []
    for trial, division in enumerate(divisions):
        if not len(division.test):
            faults.append(
                f"trial {trial}: the {counted(len(division.held_out), 'group')} held out, {division.held_out[0]} the "
                "first, lack successes or failures, expected some of both: hold out more, see --held-out"
            )
        pool = labels[division.pool]
        for size in sizes:
            if size is not None and size > len(pool):
                faults.append(f"trial {trial}: size is {size}, expected at most {len(pool)}, which are not held out")
            elif not 0 < (found := int(pool[:size].sum())) < len(pool[:size]):
                faults.append(
                    f"trial {trial}: {found} of the first {counted(len(pool[:size]), 'attempt')} are successes, "
                    "expected some of both: train on more"
                )
    return faults


def refuse(faults: Sequence[str]) -> None:
    """Raise what is wrong with a sweep, if anything is.

    Raises:
        SweepPlanError: There is a fault; the message has the first few.
    """
    if faults:
        more = f"; and {len(faults) - _FAULTS_LISTED} more" if len(faults) > _FAULTS_LISTED else ""
        raise SweepPlanError(f"{'; '.join(faults[:_FAULTS_LISTED])}{more}")
