"""The figure of calibration: how often grasps hold, over what the network said of them.

One panel for each method and object set. Points on the diagonal are grasps that hold as often as predicted; the larger
a point, the more trials it stands for. The same rows give the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from handsight.datasets.errors import counted
from handsight.evaluation.calibration import CalibrationRow
from handsight.servoing.methods.registry import METHODS
from handsight.viz.errors import FigureError
from handsight.viz.figures.rate_panels import BLUE, GREY, GRID, dress
from handsight.viz.figures.style import STYLE, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROUNDING: Final = 1e-9
MOST_COLUMNS: Final = 4
SMALLEST_PT: Final = 3.5
LARGEST_PT: Final = 9.0


def calibration_figure(rows: Sequence[CalibrationRow], path: Path) -> tuple[Path, Path]:
    """Draw rates with Wilson's 95 % intervals over the mean score of each bin.

    Args:
        rows: ``calibration`` of ``evaluate --json``; each method on each object set has a panel.
        path: Where to write; ``.png`` and ``.svg`` replace its suffix.

    Returns:
        The two files written.

    Raises:
        FigureError: There are no rows, or some cannot be drawn; nothing is written then.
    """
    _check(rows)
    panels = list(dict.fromkeys((row["objects"], row["method"]) for row in rows))
    across = min(MOST_COLUMNS, len(panels))
    down = -(-len(panels) // across)
    # Names of object sets may hold dollars, which would begin a formula.
    with mpl.rc_context({**STYLE, "text.parse_math": False}):
        size_in = (0.7 + 2.9 * across, 0.5 + 3.5 * down)
        figure = Figure(figsize=size_in, dpi=150, layout="constrained", facecolor="white")
        grid = figure.subplots(down, across, squeeze=False, sharey=True).ravel()
        for (objects, method), axes in zip(panels, grid, strict=False):
            _draw(axes, [row for row in rows if (row["objects"], row["method"]) == (objects, method)])
        for axes in grid[len(panels) :]:
            axes.set_visible(False)
        figure.supxlabel("predicted success S at the grasp", fontsize=9)
        figure.supylabel("grasps that held (95 % Wilson interval)", fontsize=9)
        return save_figure(figure, path)


def _check(rows: Sequence[CalibrationRow]) -> None:
    faults = [] if rows else ["there are no rows, expected at least one: evaluate a method that servoes"]
    seen = set()
    for row in rows:
        low, high = row["ci95"]
        name = f"{row['method']} on {row['objects']} from {row['low']:g} to {row['high']:g}"
        if row["trials"] < 1 or not 0 <= row["successes"] <= row["trials"]:
            faults.append(f"{name} has {row['successes']} of {row['trials']} held, expected 0 <= held <= trials, n > 0")
        if not (-ROUNDING <= low <= row["rate"] + ROUNDING and row["rate"] - ROUNDING <= high <= 1 + ROUNDING):
            faults.append(f"{name} has rate {row['rate']} and interval [{low}, {high}], expected the rate inside it")
        if not row["low"] - ROUNDING <= row["mean_score"] <= row["high"] + ROUNDING:
            faults.append(f"{name} has the mean score {row['mean_score']}, expected one of its bin")
        key = row["method"], row["objects"], row["low"]
        if key in seen:
            faults.append(f"{name} appears twice")
        seen.add(key)
    if faults:
        raise FigureError("; ".join(faults))


def _draw(axes: Axes, rows: Sequence[CalibrationRow]) -> None:
    most, total = max(row["trials"] for row in rows), sum(row["trials"] for row in rows)
    method = rows[0]["method"]
    name = METHODS[method].label.replace("\n", " ") if method in METHODS else method
    dress(axes, name, f"{rows[0]['objects']}, {counted(total, 'trial')}", grid="y")
    axes.grid(axis="x", color=GRID, linewidth=0.8)
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=1.0, linestyle=(0, (4, 2)), zorder=2)
    axes.annotate("as predicted", (0.05, 0.085), rotation=45, fontsize=7.5, color=GREY, rotation_mode="anchor")
    for row in rows:
        low, high = row["ci95"]
        score = row["mean_score"]
        axes.plot([score, score], [low, high], color=BLUE, linewidth=1.3, zorder=3)
        size_pt = SMALLEST_PT + (LARGEST_PT - SMALLEST_PT) * (row["trials"] / most) ** 0.5
        axes.plot([score], [row["rate"]], color=BLUE, marker="o", markersize=size_pt, zorder=4, clip_on=False)
    axes.set_xlim(-0.03, 1.03)
    axes.set_ylim(-0.03, 1.03)
    axes.set_aspect("equal", adjustable="box")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks([0.0, 0.25, 0.5, 0.75, 1.0])
        axis.set_major_formatter(PercentFormatter(1.0, decimals=0))
