"""The figure of a results table: success rate per method, with how far it can be trusted.

Written as PNG and SVG. The same rows give the same bytes, so that a figure under version control changes only when the
numbers do.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from handsight.datasets.errors import counted
from handsight.evaluation.results import ResultRow
from handsight.servoing.methods.registry import METHODS
from handsight.viz.errors import FigureError
from handsight.viz.figures.style import HATCHES, INK, STYLE, save_figure
from handsight.viz.palette import PAPER_INK, SET_INKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROUNDING: Final = 1e-9
GROUP_WIDTH: Final = 0.62
BAR_IN: Final = 1.15
"""Of the figure's width for each bar: the numbers over neighbours do not meet."""
RATE_TOP: Final = 1.0
COUNT_FITS_BELOW: Final = 0.08
"""Where the interval reaches lower than this, the count has no room inside the bar and goes above it."""
LABEL: Final[dict[str, Any]] = {"textcoords": "offset points", "ha": "center", "va": "bottom", "zorder": 5}
PATCH: Final = {"boxstyle": "square,pad=0.15", "facecolor": "white", "linewidth": 0, "alpha": 0.85}
"""Ground of the labels, so that the paper's marks pass behind them."""


def results_figure(rows: Sequence[ResultRow], path: Path) -> tuple[Path, Path]:
    """Draw success rates with Wilson's 95 % intervals beside the paper's.

    Args:
        rows: Rows of ``evaluate --json``; methods and object sets appear in their order.
        path: Where to write; ``.png`` and ``.svg`` replace its suffix.

    Returns:
        The two files written.

    Raises:
        FigureError: There are no rows, or some cannot be drawn; nothing is written then.
    """
    check_rows(rows)
    with mpl.rc_context(STYLE):
        methods = list(dict.fromkeys(row["method"] for row in rows))
        sets = dict.fromkeys(row["objects"] for row in rows)
        figure = Figure(
            figsize=(1.6 + max(1.7, BAR_IN * len(sets)) * max(len(methods), 2), 4.2),
            dpi=150,
            layout="constrained",
            facecolor="white",
        )
        axes = figure.add_subplot()
        _draw_bars(axes, rows, methods)
        _draw_paper(axes, methods)
        _dress(axes, methods)
        return save_figure(figure, path)


def check_rows(rows: Sequence[ResultRow]) -> None:
    """Refuse rows that cannot be drawn.

    Raises:
        FigureError: There are none, or some have counts, rates or intervals that do not fit; all of them are named.
    """
    faults = [] if rows else ["there are no rows, expected at least one"]
    seen = set()
    for number, row in enumerate(rows):
        low, high = row["ci95"]
        name = f"row {number} ({row['method']} on {row['objects']})"
        if row["trials"] < 1 or not 0 <= row["successes"] <= row["trials"]:
            faults.append(
                f"{name} has {counted(row['successes'], 'success', 'successes')} in {counted(row['trials'], 'trial')}, "
                "expected 0 <= s <= n, n > 0"
            )
        if not (-ROUNDING <= low <= row["rate"] + ROUNDING and row["rate"] - ROUNDING <= high <= 1 + ROUNDING):
            faults.append(
                f"{name} has rate {row['rate']} and interval [{low}, {high}], expected 0 <= lo <= rate <= hi <= 1"
            )
        if (row["method"], row["objects"]) in seen:
            faults.append(f"{name} appears twice")
        seen.add((row["method"], row["objects"]))
    if faults:
        raise FigureError("; ".join(faults))


def _draw_bars(axes: Axes, rows: Sequence[ResultRow], methods: Sequence[str]) -> None:
    sets = list(dict.fromkeys(row["objects"] for row in rows))
    width = GROUP_WIDTH / len(sets)
    for index, objects in enumerate(sets):
        chosen = [row for row in rows if row["objects"] == objects]
        centres = np.array([methods.index(row["method"]) for row in chosen]) + (index + 0.5) * width - 0.5 * GROUP_WIDTH
        rates = np.array([row["rate"] for row in chosen])
        low, high = np.array([row["ci95"] for row in chosen]).T
        axes.bar(
            centres,
            rates,
            0.94 * width,
            color=SET_INKS[index % len(SET_INKS)],
            hatch=HATCHES[index % len(HATCHES)],
            edgecolor=(1, 1, 1, 0.35),
            linewidth=0,
            label=objects,
            zorder=2,
        )
        axes.errorbar(
            centres,
            rates,
            yerr=np.maximum([rates - low, high - rates], 0.0),
            fmt="none",
            ecolor=INK,
            elinewidth=1.4,
            capsize=5,
            zorder=4,
        )
        for centre, row in zip(centres.tolist(), chosen, strict=True):
            _print_numbers(axes, centre, row)


def _print_numbers(axes: Axes, centre: float, row: ResultRow) -> None:
    low, high = row["ci95"]
    count, percent = f"n = {row['trials']}", f"{100 * row['rate']:.1f} %"
    inside = low >= COUNT_FITS_BELOW
    if inside:
        axes.annotate(count, (centre, 0.0), (0, 4), color="white", fontsize=8, **LABEL)
    else:
        axes.annotate(count, (centre, high), (0, 4), fontsize=8, bbox=PATCH, **LABEL)
    axes.annotate(percent, (centre, high), (0, 5 if inside else 16), fontweight="bold", bbox=PATCH, **LABEL)


def _draw_paper(axes: Axes, methods: Sequence[str]) -> None:
    rates = [METHODS[name].paper_rate if name in METHODS else None for name in methods]
    known = [(position, rate) for position, rate in enumerate(rates) if rate is not None]
    half = 0.5 * GROUP_WIDTH + 0.06
    for number, (position, rate) in enumerate(known):
        axes.plot(
            [position - half, position + half],
            [rate, rate],
            color=PAPER_INK,
            linewidth=1.6,
            linestyle=(0, (4, 2)),
            zorder=3,
            label="paper, Table I (novel objects)" if number == 0 else None,
        )
        axes.annotate(
            f"{100 * rate:.1f}",
            (position + half, rate),
            xytext=(3, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            color=PAPER_INK,
        )


def _dress(axes: Axes, methods: Sequence[str]) -> None:
    axes.set_xticks(range(len(methods)), [METHODS[name].label if name in METHODS else name for name in methods])
    axes.set_xlim(-0.55, len(methods) - 0.35)
    # Room for the numbers over a bar that reaches 100 %.
    axes.set_ylim(0, RATE_TOP + 0.14)
    axes.set_yticks(np.linspace(0, RATE_TOP, 6), [f"{percent} %" for percent in range(0, 101, 20)])
    axes.set_ylabel("grasps that held (95 % Wilson interval)")
    axes.grid(axis="y", color="#d8dde3", linewidth=0.8, zorder=0)
    axes.tick_params(length=0)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.figure.legend(loc="outside upper left", ncols=3, frameon=False, fontsize=9)
