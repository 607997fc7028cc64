"""The figure of a training: losses and held-out figures, pass by pass, and which pass was kept.

Every line has a dash or a marker of its own beside its colour. The same record gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from handsight.datasets.errors import counted
from handsight.viz.errors import FigureError
from handsight.viz.figures.rate_panels import GREY, dress, say
from handsight.viz.figures.style import INK, SERIES, STYLE, Series, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def training_curve_figure(record: Mapping[str, Any], path: Path) -> tuple[Path, Path]:
    """Draw the course of a training.

    Args:
        record: Of the run, as ``run_record.read_values`` gives it.
        path: Where to write; ``.png`` and ``.svg`` replace its suffix.

    Returns:
        The two files written.

    Raises:
        FigureError: The record has no pass, or the files cannot be written.
    """
    history = record["history"]
    if not history:
        raise FigureError("the record of the run has no pass to draw, expected at least one: train it again")
    kept = record.get("kept_epoch")
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.6), dpi=150, layout="constrained", facecolor="white")
        loss, quality = figure.subplots(1, 2)
        held_out = history[-1]["held_out"]["attempts"]
        dress(loss, "Cross-entropy", f"by pass over the data, {counted(held_out, 'attempt')} held out", grid="y")
        _draw(loss, history, "training", SERIES[1], [one["train_loss"] for one in history])
        _draw(loss, history, "held out", SERIES[0], [one["held_out"]["loss"] for one in history])
        dress(quality, "On held-out attempts", "balanced accuracy at S > 0.5, and area under the ROC curve", grid="y")
        _draw(quality, history, "AUC", SERIES[0], [one["held_out"]["auc"] for one in history])
        _draw(quality, history, "balanced accuracy", SERIES[1], [one["held_out"]["accuracy"] for one in history])
        if not quality.lines:
            say(quality, "too few attempts held out to say")
        else:
            quality.set_ylim(min(0.48, *(min(map(float, line.get_ydata())) - 0.02 for line in quality.lines)), 1.01)
        for axes in (loss, quality):
            _scale(axes, len(history), kept)
        return save_figure(figure, path)


def _draw(
    axes: Axes, history: Sequence[Mapping[str, Any]], label: str, series: Series, values: Sequence[float | None]
) -> None:
    known = [(one["number"], value) for one, value in zip(history, values, strict=True) if value is not None]
    if known:
        passes, heights = zip(*known, strict=True)
        axes.plot(passes, heights, label=label, markevery=max(1, len(known) // 12), **series.line())


def _scale(axes: Axes, passes: int, kept: int | None) -> None:
    if not axes.lines:
        return
    axes.set_xlim(0.5, passes + 0.5)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=10, integer=True))
    axes.set_xlabel("pass", fontsize=8, color=GREY)
    if kept is not None:
        axes.axvline(kept, color=INK, linewidth=0.9, linestyle=(0, (1, 2)), label=f"kept: pass {kept}", zorder=1)
    axes.legend(frameon=False, fontsize=8)
