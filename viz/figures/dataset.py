"""The figure of a dataset: how grasps succeeded by object, place, angle, opening, contact force, and over time.

Written as PNG or SVG. The same numbers give the same bytes.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator

from handsight.datasets.reading.stats import Histogram, LabelStats, PositionMap
from handsight.evaluation.results import wilson_95
from handsight.viz import palette
from handsight.viz.errors import FigureError
from handsight.viz.figures.rate_panels import (
    draw_angles,
    draw_contact,
    draw_objects,
    draw_progress,
    dress,
    number,
    numbered,
    object_rows,
    percent,
    say,
    shortened,
)
from handsight.viz.figures.style import INK, STYLE, check_figure_path, save_png, save_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUFFIXES: Final = (".png", ".svg")
BARE: Final = "#eef0f3"
"""Table on which too few grasps were attempted."""
FEWEST_IN_A_CELL: Final = 10
MAP_COLOURS: Final = LinearSegmentedColormap.from_list("success", ["#f3e9c6", "#7fb08a", "#3f6ea3", "#2b2457"])
"""From low to high; dark where grasps succeed, so that it reads on a light ground and without colour."""

OBJECTS_WIDTH_IN: Final = 4.3
PANEL_WIDTH_IN: Final = 3.7
HEIGHT_IN: Final = 8.2
PAD_IN: Final = 0.09
ROW_IN: Final = 0.172
"""Height of an object's row."""


def stats_figure(found: LabelStats, path: Path, *, title: str) -> Path:
    """Draw the spread of labels in a version, with Wilson's 95 % intervals.

    Args:
        found: Of ``label_stats``.
        path: What to write; its suffix, ``.png`` or ``.svg``, says how.
        title: What was counted, such as ``grasps@v1``.

    Returns:
        The file written.

    Raises:
        FigureError: There is no labelled attempt, or the path cannot be written; nothing is written then.
    """
    check_figure_path(path, *SUFFIXES)
    if not found.labelled:
        raise FigureError(
            f"{title} has no labelled attempt that is not excluded, expected some to draw: "
            "collect more, or restore some"
        )
    # Names of objects and datasets may hold dollars, which would begin a formula.
    with mpl.rc_context({**STYLE, "font.size": 9, "text.parse_math": False}):
        layout = ConstrainedLayoutEngine(w_pad=PAD_IN, h_pad=PAD_IN)
        figure = Figure(figsize=_size_in(found), dpi=150, layout=layout, facecolor="white")
        figure.suptitle(_headline(found, title), x=0.012, ha="left", fontsize=10.5)
        _draw_panels(figure, found)
        return (save_png if path.suffix.lower() == ".png" else save_svg)(figure, path)


def _size_in(found: LabelStats) -> tuple[float, float]:
    width_in = 2 * PANEL_WIDTH_IN + (OBJECTS_WIDTH_IN if found.objects else 0.0)
    return width_in, max(HEIGHT_IN, 1.2 + ROW_IN * len(object_rows(found.objects)))


def _headline(found: LabelStats, title: str) -> str:
    low, high = wilson_95(found.successes, found.labelled)
    return (
        f"{shortened(title)}: {number(found.successes)} of {numbered(found.labelled, 'labelled attempt')} succeed, "
        f"{percent(found.successes / found.labelled)}\n"
        f"95 % Wilson interval {percent(low)} to {percent(high)}; "
        f"left out: {number(found.unlabelled)} without a label, {number(found.excluded)} excluded"
    )


def _draw_panels(figure: Figure, found: LabelStats) -> None:
    """The objects at the left where targets are known, the small panels in two columns, time along the foot."""
    widths = [PANEL_WIDTH_IN, PANEL_WIDTH_IN]
    first = 0
    if found.objects:
        widths.insert(0, OBJECTS_WIDTH_IN)
        first = 1
    grid = GridSpec(3, len(widths), figure, width_ratios=widths, height_ratios=[1.25, 1.0, 0.9])
    overall = found.successes / found.labelled
    if found.objects:
        draw_objects(figure.add_subplot(grid[:, 0]), found.objects, overall)
    _draw_map(figure.add_subplot(grid[0, first]), found.positions)
    draw_angles(figure.add_subplot(grid[0, first + 1]), found.angle_bins_rad, overall)
    _draw_openings(figure.add_subplot(grid[1, first]), found.width_bins_m)
    draw_contact(figure.add_subplot(grid[1, first + 1]), found.no_contact, found.contact_bins_n, overall)
    draw_progress(figure.add_subplot(grid[2, first:]), found.windows, found.window_attempts, overall)


def _draw_openings(axes: Axes, histogram: Histogram) -> None:
    """Counts on a logarithmic scale: nearly all failures lie in the bin of closed jaws."""
    dress(axes, "Final opening by label", "counts on a logarithmic scale", grid="y")
    if not histogram.edges:
        say(axes, "no opening was recorded")
        return
    edges_mm = 1e3 * np.array(histogram.edges)
    if edges_mm[-1] == edges_mm[0]:
        edges_mm += np.array([-0.5, 0.5])
    held = np.array(histogram.successes)
    empty = np.array(histogram.attempts) - held
    for counts, colour, name, hatch in ((empty, palette.EMPTY, "failed", "//"), (held, palette.HELD, "succeeded", "")):
        axes.stairs(
            counts,
            edges_mm,
            fill=True,
            facecolor=palette.ink(colour),
            edgecolor="white",
            linewidth=0,
            hatch=hatch,
            alpha=0.75,
            label=name,
            baseline=0.5,
            zorder=2,
        )
    axes.set_yscale("log")
    axes.set_ylim(0.5, 2.5 * max(histogram.attempts))
    axes.minorticks_off()
    axes.yaxis.set_major_formatter(lambda count, _: number(round(count)) if count >= 1 else "")
    axes.set_xlabel("opening of the jaws at the end [mm]")
    axes.set_ylabel("attempts")
    axes.legend(frameon=False, fontsize=8, loc="upper right", handlelength=1.0)


def _draw_map(axes: Axes, positions: PositionMap) -> None:
    """Success rate by place; cells with too few attempts stay bare."""
    attempts, successes = (np.array(counts, dtype=float).T for counts in (positions.attempts, positions.successes))
    fewest = FEWEST_IN_A_CELL if (attempts >= FEWEST_IN_A_CELL).any() else 1
    dress(axes, "Success over the table, from above", f"grey: fewer than {fewest} attempts" if fewest > 1 else "")
    if not positions.attempts:
        say(axes, "no grasp position was recorded")
        return
    drawn = attempts >= fewest
    rates = np.divide(successes, attempts, out=np.full_like(attempts, np.nan), where=drawn)
    # Nearly the highest rate: a cell with few attempts would stretch the scale by luck.
    top = float(np.quantile(rates[drawn], 0.98, weights=attempts[drawn], method="inverted_cdf"))
    beyond: Literal["max", "neither"] = "max" if rates[drawn].max() > top > 0 else "neither"
    axes.set_facecolor(BARE)
    mesh = axes.pcolormesh(
        positions.x_edges_m, positions.y_edges_m, rates, cmap=MAP_COLOURS, vmin=0.0, vmax=top or 0.01
    )
    axes.set_aspect("equal", adjustable="box")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    axes.set_xlabel("x in the base frame [m]")
    axes.set_ylabel("y [m]")
    bar = axes.figure.colorbar(mesh, ax=axes, shrink=0.85, aspect=18, pad=0.02, extend=beyond)
    bar.ax.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    bar.ax.yaxis.set_major_formatter(lambda rate, _: f"{round(100 * rate, 3):g} %")
    bar.outline.set_visible(False)
    bar.ax.tick_params(length=0, labelsize=8, labelcolor=INK)
