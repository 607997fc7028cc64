"""The figure of calibration: how often grasps hold, over what the network said of them.

One panel for each object set. Points on the diagonal are grasps that hold as often as predicted; the size of a point
says how many trials it stands for. The same rows give the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Final

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import PercentFormatter

from handsight.datasets.errors import counted
from handsight.evaluation.calibration import CalibrationRow
from handsight.servoing.methods.registry import METHODS
from handsight.viz.errors import FigureError
from handsight.viz.figures.rate_panels import GREY, dress
from handsight.viz.figures.style import SERIES, STYLE, Series, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROUNDING: Final = 1e-9
SPREAD: Final = 0.006
"""By how much the points of neighbouring methods stand apart, in predicted success."""
SMALLEST_PT: Final = 3.5
LARGEST_PT: Final = 10.0


def calibration_figure(rows: Sequence[CalibrationRow], path: Path) -> tuple[Path, Path]:
    """Draw rates with Wilson's 95 % intervals over the mean score of each bin.

    Args:
        rows: ``calibration`` of ``evaluate --json``; object sets are panels, methods series.
        path: Where to write; ``.png`` and ``.svg`` replace its suffix.

    Returns:
        The two files written.

    Raises:
        FigureError: There are no rows, or some cannot be drawn; nothing is written then.
    """
    _check(rows)
    sets = list(dict.fromkeys(row["objects"] for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    with mpl.rc_context({**STYLE, "text.parse_math": False}):
        figure = Figure(figsize=(0.9 + 4.6 * len(sets), 5.2), dpi=150, layout="constrained", facecolor="white")
        panels = figure.subplots(1, len(sets), squeeze=False, sharey=True)[0]
        for objects, axes in zip(sets, panels, strict=True):
            for at, (method, series) in enumerate(zip(methods, cycle(SERIES))):
                chosen = [row for row in rows if (row["method"], row["objects"]) == (method, objects)]
                _draw(axes, chosen, series, apart=SPREAD * (2 * at - len(methods) + 1))
            some = [row for row in rows if row["objects"] == objects]
            _dress(axes, objects, some)
        handles = [
            Line2D([], [], label=_label(name), **series.line())
            for name, series in zip(methods, cycle(SERIES), strict=False)
        ]
        figure.legend(handles=handles, loc="outside upper left", ncols=3, frameon=False, fontsize=9)
        return save_figure(figure, path)


def _check(rows: Sequence[CalibrationRow]) -> None:
    faults = [] if rows else ["there are no rows, expected at least one: evaluate a method that servoes"]
    for row in rows:
        low, high = row["ci95"]
        name = f"{row['method']} on {row['objects']} from {row['low']:g} to {row['high']:g}"
        if row["trials"] < 1 or not 0 <= row["successes"] <= row["trials"]:
            faults.append(f"{name} has {row['successes']} of {row['trials']} held, expected 0 <= held <= trials, n > 0")
        if not (-ROUNDING <= low <= row["rate"] + ROUNDING and row["rate"] - ROUNDING <= high <= 1 + ROUNDING):
            faults.append(f"{name} has rate {row['rate']} and interval [{low}, {high}], expected the rate inside it")
        if not row["low"] - ROUNDING <= row["mean_score"] <= row["high"] + ROUNDING:
            faults.append(f"{name} has the mean score {row['mean_score']}, expected one of its bin")
    if faults:
        raise FigureError("; ".join(faults))


def _draw(axes: Axes, rows: Sequence[CalibrationRow], series: Series, *, apart: float) -> None:
    most = max((row["trials"] for row in rows), default=1)
    scores = [row["mean_score"] + apart for row in rows]
    rates = [row["rate"] for row in rows]
    axes.plot(scores, rates, color=series.ink, linestyle=series.dash, linewidth=1.1, zorder=3)
    for score, row in zip(scores, rows, strict=True):
        low, high = row["ci95"]
        axes.plot([score, score], [low, high], color=series.ink, linewidth=1.2, zorder=3)
        size_pt = SMALLEST_PT + (LARGEST_PT - SMALLEST_PT) * (row["trials"] / most) ** 0.5
        axes.plot([score], [row["rate"]], color=series.ink, marker=series.marker, markersize=size_pt, zorder=4)


def _dress(axes: Axes, objects: str, rows: Sequence[CalibrationRow]) -> None:
    counts = sorted(row["trials"] for row in rows)
    note = f"{objects}, {counted(sum(counts), 'trial')}; {counts[0]} to {counts[-1]} a point, larger points more"
    dress(axes, "Calibration", note, grid="y")
    axes.grid(axis="x", color="#d8dde3", linewidth=0.8)
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=1.0, linestyle=(0, (4, 2)), zorder=2)
    axes.annotate("as predicted", (0.04, 0.065), rotation=45, fontsize=7.5, color=GREY, rotation_mode="anchor")
    axes.set_xlim(-0.03, 1.03)
    axes.set_ylim(-0.03, 1.03)
    axes.set_aspect("equal", adjustable="box")
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_xlabel("predicted success S at the grasp", fontsize=9)
    axes.set_ylabel("grasps that held (95 % Wilson interval)", fontsize=9)


def _label(method: str) -> str:
    return METHODS[method].label.replace("\n", " ") if method in METHODS else method
