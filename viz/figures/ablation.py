"""The figure of a sweep: balanced accuracy against the size of the training set (figure 7), and objects by accuracy.

Each series has its own colour, marker and dash, so that they are told apart without colour too. The same rows give the
same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Final

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, PercentFormatter

from handsight.training.sweep.table import ObjectRow, SweepRow
from handsight.viz.errors import FigureError
from handsight.viz.figures.rate_panels import GREY, dress, shortened
from handsight.viz.figures.style import INK, SERIES, STYLE, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SPREAD: Final = 0.02
"""By how much the points of neighbouring series stand apart, as a factor of the size."""
_MOST_OBJECTS: Final = 40


def ablation_figure(rows: Sequence[SweepRow], objects: Sequence[ObjectRow], path: Path) -> tuple[Path, Path]:
    """Draw accuracy and area under the curve against size, and accuracy by object at the largest size.

    Args:
        rows: Points, at least one.
        objects: Of all points; those of the largest size are drawn.
        path: Where to write, with any suffix.

    Returns:
        The PNG and the SVG.

    Raises:
        FigureError: There is no point, or the files cannot be written.
    """
    if not rows:
        raise FigureError("there is no finished cell to draw, expected at least one: train some first")
    shown = _largest(rows, objects)
    names = list(dict.fromkeys(row.object for row in shown))[:_MOST_OBJECTS]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, max(4.8, 1.4 + 0.19 * len(names))), dpi=110, layout="constrained")
        accuracy, auc, by_object = figure.subplots(1, 3, width_ratios=(1.2, 1.2, 1.0))
        _draw_curves(accuracy, rows, "accuracy")
        _draw_curves(auc, rows, "auc")
        handles, labels = accuracy.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3, frameon=False, fontsize=9, handlelength=3.2)
        _draw_objects(by_object, shown, names, list(dict.fromkeys(row.series for row in rows)))
        return save_figure(figure, path)


def _largest(rows: Sequence[SweepRow], objects: Sequence[ObjectRow]) -> list[ObjectRow]:
    size = max(rows, key=lambda row: row.trained_on).size
    return [row for row in objects if row.size == size]


def _draw_curves(axes: Axes, rows: Sequence[SweepRow], which: str) -> None:
    """Means with their intervals, a line for each series."""
    names = list(dict.fromkeys(row.series for row in rows))
    for at, (name, series) in enumerate(zip(names, cycle(SERIES))):
        points = [(row.trained_on, getattr(row, which)) for row in rows if row.series == name]
        apart = (1 + _SPREAD) ** (2 * at - len(names) + 1)
        sizes, means = [size * apart for size, _ in points], [mean.mean for _, mean in points]
        axes.plot(sizes, means, label=name, **series.line())
        for size, (_, mean) in zip(sizes, points, strict=True):
            if mean.low is not None:
                axes.plot([size, size], [mean.low, mean.high], color=series.ink, linewidth=1.1, alpha=0.75)
    sizes = sorted({row.trained_on for row in rows})
    axes.set_xscale("log")
    axes.set_xticks(sizes, [f"{size:,.0f}" for size in sizes], rotation=35, ha="right")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("attempts in the training set")
    trials = sorted({row.accuracy.trials for row in rows})
    n = f"n = {trials[0]}" if len(trials) == 1 else f"n = {trials[0]} to {trials[-1]}"
    title = "Balanced accuracy, S > 0.5" if which == "accuracy" else "Area under the ROC curve"
    dress(axes, title, f"mean and 95 % interval over trials, {n}", grid="y")
    # Intervals of few trials reach beyond what there can be.
    least = min([0.5, *(mean.low for row in rows if (mean := getattr(row, which)).low is not None)])
    axes.set_ylim(max(0.0, least - 0.02), 1.0)
    if which == "accuracy":
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))


def _draw_objects(axes: Axes, rows: Sequence[ObjectRow], names: Sequence[str], series: Sequence[str]) -> None:
    """Accuracy on each object that was held out, the worst on top."""
    for name, one in zip(series, cycle(SERIES)):
        found = {row.object: row.correct / row.attempts for row in rows if row.series == name}
        at = [row for row, target in enumerate(names) if target in found]
        axes.plot(
            [found[names[row]] for row in at],
            at,
            color=one.ink,
            marker=one.marker,
            linestyle="none",
            markersize=4.5,
            alpha=0.9,
        )
    axes.set_yticks(range(len(names)), [shortened(name) for name in names], fontsize=7)
    axes.invert_yaxis()
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.axvline(0.5, color=GREY, linewidth=0.8)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", color=INK, alpha=0.08)
    size = "all" if not rows or rows[0].size is None else f"{rows[0].size:,}"
    dress(axes, "Objects never seen", f"share judged rightly, training sets of {size}", grid="x")
