"""How labels are spread: by object, by session, over grasp angle, position, final opening and contact force, over time.

Excluded attempts and attempts without label do not count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.format.decisions import trainable
from handsight.datasets.reading.reader import GraspDataset

BINS = 8
"""Rows for each quantity in the tables, at most."""
FEWEST_IN_A_BIN = 5
"""Attempts for which another row is worth its place."""
ANGLE_BINS = 12
"""Of 15 degrees each."""
WIDTH_BINS = 40
CELL_ATTEMPTS = 80
"""Attempts that a cell of the map should hold on average: their success rate is known to 11 percentage points or less
on either side."""
MAP_CELLS = (4, 24)
"""Fewest and most cells along the longer side of the map."""
WINDOW_ATTEMPTS = 1000
"""Attempts in a window of a session, for versions that have ``WINDOWS`` such windows or more."""
WINDOWS = 8
SMALL_WINDOWS = (500, 200, 100, 50, 20, 10)
"""What smaller versions take instead: the first of which they have ``WINDOWS``, or the last."""

_COLUMNS = (
    "success",
    "excluded",
    "target",
    "session",
    "number",
    "pregrasp_x_m",
    "pregrasp_y_m",
    "pregrasp_angle_rad",
    "width_final_m",
    "contact_force_n",
)


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
class Histogram:
    """Labelled attempts counted in bins of one quantity. A bin holds its lower edge, the last one the upper one too."""

    edges: tuple[float, ...]
    """Ascending, one more than bins; empty where no value is finite. Both edges of a single bin may be equal."""
    attempts: tuple[int, ...]
    successes: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionMap:
    """Labelled attempts counted in square cells of the table, by where the grasp was to be, in the base frame."""

    x_edges_m: tuple[float, ...]
    """Ascending, X + 1 of them; empty where no position is known."""
    y_edges_m: tuple[float, ...]
    attempts: tuple[tuple[int, ...], ...]
    """One row for each cell along x. Shape (X, Y)."""
    successes: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Labelled attempts of a session that follow one another."""

    session: str
    first: int
    """Number in the session of the first of them."""
    last: int
    attempts: int
    successes: int


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
    """By grasp angle, taken within half a turn: a jaw turned by half a turn is the same jaw.

    This one and the next two in rows of nearly equal counts, each called after the smallest and the largest value that
    it holds. A value that many attempts share, such as the opening of closed jaws, has a row to itself.
    """
    width_m: tuple[Share, ...]
    """By final opening."""
    force_n: tuple[Share, ...]
    """By contact force."""
    angle_bins_rad: Histogram
    """Over the whole half turn, from -pi/2 to pi/2."""
    width_bins_m: Histogram
    """In bins of equal width."""
    no_contact: Share
    """Attempts that met nothing on the way down to the table."""
    contact_bins_n: Histogram
    """By contact force of those that did meet something, in bins of nearly equal counts."""
    positions: PositionMap
    window_attempts: int
    """Attempts in a window, nearly."""
    windows: tuple[Window, ...]
    """The sessions one after another, each cut into windows."""


def label_stats(dataset: GraspDataset) -> LabelStats:
    """Count labels. Reads no pictures."""
    table = dataset.table(*_COLUMNS)
    rows = table[trainable(table)]
    success = rows["success"].astype(bool)
    labels = success.to_numpy()
    angle_rad = (rows["pregrasp_angle_rad"].to_numpy() + math.pi / 2) % math.pi - math.pi / 2
    width_m, force_n = rows["width_final_m"].to_numpy(), rows["contact_force_n"].to_numpy()
    met_none = force_n <= 0
    size = _window_size(len(rows))
    return LabelStats(
        labelled=len(rows),
        successes=int(success.sum()),
        excluded=int(table["excluded"].sum()),
        unlabelled=int((table["success"].isna() & ~table["excluded"]).sum()),
        objects=_by_value(rows["target"], success),
        sessions=_by_value(rows["session"], success),
        angle_rad=_by_quantile(angle_rad, labels),
        width_m=_by_quantile(width_m, labels),
        force_n=_by_quantile(force_n, labels),
        angle_bins_rad=_counted(angle_rad, labels, np.linspace(-math.pi / 2, math.pi / 2, ANGLE_BINS + 1)),
        width_bins_m=_counted(width_m, labels, _equal_edges(width_m, WIDTH_BINS)),
        no_contact=Share(name="no contact", attempts=int(met_none.sum()), successes=int(labels[met_none].sum())),
        contact_bins_n=_counted(force_n[~met_none], labels[~met_none], _quantile_edges(force_n[~met_none])),
        positions=_position_map(rows["pregrasp_x_m"].to_numpy(), rows["pregrasp_y_m"].to_numpy(), labels),
        window_attempts=size,
        windows=_windows(rows, labels, size),
    )


def _by_value(values: pd.Series[str], success: pd.Series[bool]) -> tuple[Share, ...]:
    counts = success.groupby(values).agg(["size", "sum"])
    return tuple(
        Share(name=str(name), attempts=int(size), successes=int(successes))
        for name, size, successes in counts.itertuples()
    )


def _by_quantile(values: NDArray[np.float64], labels: NDArray[np.bool_]) -> tuple[Share, ...]:
    """Rows of nearly equal counts, ascending; equal values are never apart, and frequent ones are by themselves."""
    finite = np.isfinite(values)
    values, labels = values[finite], labels[finite]
    distinct, counts = np.unique(values, return_counts=True)
    frequent = counts * BINS > len(values)
    # Cut at the first of every frequent value, behind it, and among the others where equally many attempts lie before.
    cuts = {0, len(distinct), *np.flatnonzero(frequent), *(np.flatnonzero(frequent) + 1)}
    others = np.where(frequent, 0, counts)
    rows = max(1, min(BINS - int(frequent.sum()), int(others.sum()) // FEWEST_IN_A_BIN))
    before = np.cumsum(others) - others
    cuts |= {int(np.searchsorted(before, others.sum() * row / rows)) for row in range(1, rows)}
    at = np.searchsorted(distinct, values)
    return tuple(
        _row(distinct[low], distinct[high - 1], labels[(at >= low) & (at < high)])
        for low, high in pairwise(sorted(cuts))
    )


def _row(low: float, high: float, labels: NDArray[np.bool_]) -> Share:
    name = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
    return Share(name=name, attempts=len(labels), successes=int(labels.sum()))


def _equal_edges(values: NDArray[np.float64], bins: int) -> NDArray[np.float64]:
    """Edges between the smallest and the largest finite value; of a single bin where these are equal."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return np.empty(0)
    low, high = float(finite.min()), float(finite.max())
    return np.linspace(low, high, bins + 1) if high > low else np.array([low, high])


def _quantile_edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Edges between which nearly equal numbers of the finite values lie; fewer where many values are equal."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return np.empty(0)
    edges: NDArray[np.float64] = np.unique(np.quantile(finite, np.linspace(0, 1, BINS + 1)))
    return edges if len(edges) > 1 else np.repeat(edges, 2)


def _counted(values: NDArray[np.float64], labels: NDArray[np.bool_], edges: NDArray[np.float64]) -> Histogram:
    """The attempts with finite values in the bins between the edges, of which there are none or at least two."""
    if not len(edges):
        return Histogram(edges=(), attempts=(), successes=())
    finite = np.isfinite(values)
    which = np.clip(np.searchsorted(edges, values[finite], side="right") - 1, 0, len(edges) - 2)
    attempts = np.bincount(which, minlength=len(edges) - 1)
    successes = np.bincount(which, weights=labels[finite], minlength=len(edges) - 1).astype(np.int64)
    return Histogram(
        edges=tuple(edges.tolist()), attempts=tuple(attempts.tolist()), successes=tuple(successes.tolist())
    )


def _position_map(x_m: NDArray[np.float64], y_m: NDArray[np.float64], labels: NDArray[np.bool_]) -> PositionMap:
    known = np.isfinite(x_m) & np.isfinite(y_m)
    if not known.any():
        return PositionMap(x_edges_m=(), y_edges_m=(), attempts=(), successes=())
    x_m, y_m, labels = x_m[known], y_m[known], labels[known]
    side = int(np.clip(math.sqrt(len(labels) / CELL_ATTEMPTS), *MAP_CELLS))
    # A millimetre more than the extent, so that no attempt lies on the last edge and a single place has a cell.
    cell_m = (max(float(np.ptp(x_m)), float(np.ptp(y_m))) + 1e-3) / side
    edges = [values.min() + cell_m * np.arange(int(np.ptp(values) / cell_m) + 2) for values in (x_m, y_m)]
    attempts = np.histogram2d(x_m, y_m, bins=edges)[0].astype(np.int64)
    successes = np.histogram2d(x_m[labels], y_m[labels], bins=edges)[0].astype(np.int64)
    return PositionMap(
        x_edges_m=tuple(edges[0].tolist()),
        y_edges_m=tuple(edges[1].tolist()),
        attempts=_rows_of(attempts),
        successes=_rows_of(successes),
    )


def _rows_of(counts: NDArray[np.int64]) -> tuple[tuple[int, ...], ...]:
    rows: list[list[int]] = counts.tolist()
    return tuple(map(tuple, rows))


def _window_size(attempts: int) -> int:
    sizes = (WINDOW_ATTEMPTS, *SMALL_WINDOWS)
    return next((size for size in sizes if attempts >= WINDOWS * size), sizes[-1])


def _windows(rows: pd.DataFrame, labels: NDArray[np.bool_], size: int) -> tuple[Window, ...]:
    """Each session in as many windows as have nearly the size, so that no remainder stands for a few attempts."""
    found = []
    for session, positions in rows.groupby("session", sort=False).indices.items():
        for window in np.array_split(positions, max(1, round(len(positions) / size))):
            numbers: NDArray[Any] = rows["number"].to_numpy()[window]
            found.append(
                Window(
                    session=str(session),
                    first=int(numbers[0]),
                    last=int(numbers[-1]),
                    attempts=len(window),
                    successes=int(labels[window].sum()),
                )
            )
    return tuple(found)
