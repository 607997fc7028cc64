"""How labels are spread: by object, by session, over grasp angle, final opening and contact force.

Excluded attempts and attempts without label do not count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from handsight.datasets.reader import GraspDataset

BINS = 8
"""Bins of equal width for each quantity."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """The successes among some labelled attempts."""

    name: str
    """An object, a session, or the range of a bin."""
    attempts: int
    successes: int

    @property
    def rate(self) -> float:
        """Share of successes; NaN where there are no attempts."""
        return self.successes / self.attempts if self.attempts else math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelStats:
    """The spread of labels in one version."""

    labelled: int
    successes: int
    excluded: int
    unlabelled: int
    objects: tuple[Share, ...]
    """By target, sorted by name; attempts whose target is unknown are left out."""
    sessions: tuple[Share, ...]
    angle_rad: tuple[Share, ...]
    """By grasp angle, taken within half a turn: a jaw turned by half a turn is the same jaw."""
    width_m: tuple[Share, ...]
    """By final opening."""
    force_n: tuple[Share, ...]
    """By contact force."""


def label_stats(dataset: GraspDataset) -> LabelStats:
    """Count labels. Reads no pictures."""
    table = dataset.attempts
    rows = table[table["success"].notna() & ~table["excluded"]]
    success = rows["success"].astype(bool)
    return LabelStats(
        labelled=len(rows),
        successes=int(success.sum()),
        excluded=int(table["excluded"].sum()),
        unlabelled=int((table["success"].isna() & ~table["excluded"]).sum()),
        objects=_by_value(rows["target"], success),
        sessions=_by_value(rows["session"], success),
        angle_rad=_by_bin((rows["pregrasp_angle_rad"] + math.pi / 2) % math.pi - math.pi / 2, success),
        width_m=_by_bin(rows["width_final_m"], success),
        force_n=_by_bin(rows["contact_force_n"], success),
    )


def _by_value(values: pd.Series[str], success: pd.Series[bool]) -> tuple[Share, ...]:
    counts = success.groupby(values).agg(["size", "sum"])
    return tuple(
        Share(name=str(name), attempts=int(size), successes=int(successes))
        for name, size, successes in counts.itertuples()
    )


def _by_bin(values: pd.Series[float], success: pd.Series[bool]) -> tuple[Share, ...]:
    """Bins between the smallest and the largest finite value; a single bin where these are equal."""
    finite = np.isfinite(values.to_numpy())
    if not finite.any():
        return ()
    low, high = float(values[finite].min()), float(values[finite].max())
    edges = np.linspace(low, high, BINS + 1) if high > low else np.array([low, high])
    which = np.clip(np.searchsorted(edges, values[finite], side="right") - 1, 0, len(edges) - 2)
    attempts = np.bincount(which, minlength=len(edges) - 1)
    successes = np.bincount(which, weights=success[finite].to_numpy(dtype=float), minlength=len(edges) - 1)
    return tuple(
        Share(name=f"{edges[at]:.4g} to {edges[at + 1]:.4g}", attempts=int(attempts[at]), successes=int(successes[at]))
        for at in range(len(attempts))
    )
