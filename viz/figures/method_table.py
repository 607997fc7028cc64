"""Tables I and II as a figure: a row for each method, a column for each object set, beside what the paper reports.

Rates are drawn with Wilson's 95 % intervals, the paper's as open diamonds, and the time a step takes stands behind
them. The same rows give the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Literal

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import PercentFormatter

from handsight.evaluation.results import ResultRow
from handsight.servoing.methods.registry import METHODS
from handsight.viz.figures.rate_panels import BLUE, GREY, dress, percent, say, shortened
from handsight.viz.figures.results import check_rows
from handsight.viz.figures.style import INK, STYLE, save_figure
from handsight.viz.palette import PAPER_INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Source = Literal["sim", "ur10"]


@dataclass(frozen=True, slots=True)
class PaperRow:
    """A row of a table of the paper."""

    training: float
    """Success rate on objects that the network was trained on."""
    testing: float
    """The same on novel objects."""
    step_ms: float | None = None
    """Query time [ms]."""


TABLES: Final[Mapping[Source, tuple[str, Mapping[str, PaperRow]]]] = MappingProxyType(
    {
        "sim": (
            "Table I",
            {
                "random": PaperRow(0.200, 0.185),
                "first-order": PaperRow(0.810, 0.810, 47),
                "second-order": PaperRow(0.645, 0.620, 89),
                "gauss-newton": PaperRow(0.770, 0.745, 62),
                "cem-1": PaperRow(0.775, 0.750, 204),
                "cem-5": PaperRow(0.725, 0.745, 985),
            },
        ),
        "ur10": (
            "Table II",
            {
                "random": PaperRow(0.200, 0.178),
                "first-order": PaperRow(0.710, 0.650),
                "cem-1": PaperRow(0.845, 0.780),
            },
        ),
    }
)
"""What the paper reports of each station: its Table I in simulation, its Table II on the real arm."""
ROW_IN: Final = 0.52
NAMES_IN: Final = 1.6
PANEL_IN: Final = 3.3
TIMES_IN: Final = 1.5
NOTE: Final[dict[str, Any]] = {"textcoords": "offset points", "va": "center", "fontsize": 8}
LEGEND: Final[dict[str, Any]] = {"frameon": False, "fontsize": 8.5}
PAPER_MARK: Final[dict[str, Any]] = {
    "color": PAPER_INK,
    "marker": "D",
    "markersize": 5,
    "markerfacecolor": "white",
    "linestyle": "none",
}


def method_table_figure(rows: Sequence[ResultRow], path: Path, *, source: Source = "sim") -> tuple[Path, Path]:
    """Draw a table of results in the manner of the paper's.

    Args:
        rows: ``rows`` of ``evaluate --json``; methods and object sets appear in their order.
        path: Where to write; ``.png`` and ``.svg`` replace its suffix.
        source: Which station, and with it which table of the paper.

    Returns:
        The two files written.

    Raises:
        FigureError: There are no rows, or some cannot be drawn; nothing is written then.
    """
    check_rows(rows)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    sets = list(dict.fromkeys(row["objects"] for row in rows))
    title, paper = TABLES[source]
    with mpl.rc_context({**STYLE, "text.parse_math": False}):
        size_in = (NAMES_IN + PANEL_IN * len(sets) + TIMES_IN, 1.5 + ROW_IN * len(methods))
        figure = Figure(figsize=size_in, dpi=150, layout="constrained", facecolor="white")
        widths = [PANEL_IN] * len(sets) + [TIMES_IN]
        *panels, times = figure.subplots(1, len(sets) + 1, sharey=True, width_ratios=widths)
        for objects, axes in zip(sets, panels, strict=True):
            _draw_set(axes, [row for row in rows if row["objects"] == objects], methods, paper, objects)
        _draw_times(times, rows, methods, paper)
        panels[0].set_yticks(range(len(methods)), [_label(name) for name in methods], fontsize=9)
        panels[0].set_ylim(len(methods) - 0.4, -0.6)
        figure.legend(handles=_legend(title, paper, methods), loc="outside upper left", ncols=2, **LEGEND)
        return save_figure(figure, path)


def _draw_set(
    axes: Axes, rows: Sequence[ResultRow], methods: Sequence[str], paper: Mapping[str, PaperRow], objects: str
) -> None:
    counts = sorted({row["trials"] for row in rows})
    trials = f"n = {counts[0]}" if len(counts) == 1 else f"n = {counts[0]} to {counts[-1]}"
    # Sets are called after what they are for.
    seen = objects.endswith("-train")
    dress(axes, shortened(objects), f"{trials}; objects {'of the training set' if seen else 'never seen'}", grid="x")
    for at, method in enumerate(methods):
        if method in paper:
            rate = paper[method].training if seen else paper[method].testing
            axes.plot([rate], [at + 0.24], zorder=3, **PAPER_MARK)
    for row in rows:
        at, (low, high) = methods.index(row["method"]), row["ci95"]
        axes.plot([low, high], [at, at], color=BLUE, linewidth=1.8, zorder=3)
        axes.plot([row["rate"]], [at], color=BLUE, marker="o", markersize=6, zorder=4)
        text = f"{percent(row['rate'])}"
        axes.annotate(text, (row["rate"], at), (0, 10), ha="center", fontweight="bold", color=INK, **NOTE)
    axes.set_xlim(-0.05, 1.08)
    axes.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.tick_params(axis="y", length=0)


def _draw_times(axes: Axes, rows: Sequence[ResultRow], methods: Sequence[str], paper: Mapping[str, PaperRow]) -> None:
    """The time of a step as text: hardly anything else has so little to do with the other columns."""
    reported = any(method in paper and paper[method].step_ms is not None for method in methods)
    dress(axes, "Time a step", "median; grey: paper" if reported else "median")
    say(axes, "")
    for at, method in enumerate(methods):
        ours = [row["step_ms"] for row in rows if row["method"] == method and row["step_ms"] is not None]
        theirs = paper[method].step_ms if method in paper else None
        axes.annotate(
            "–" if not ours else f"{ours[0]:.0f} ms", (0, at), (0, 0 if theirs is None else 5), color=INK, **NOTE
        )
        if theirs is not None:
            axes.annotate(f"{theirs:.0f} ms", (0, at), (0, -7), color=GREY, **NOTE)
    axes.set_xlim(-0.05, 1)
    axes.tick_params(axis="y", left=False, labelleft=False)


def _legend(title: str, paper: Mapping[str, PaperRow], methods: Sequence[str]) -> list[Line2D]:
    ours = Line2D([], [], color=BLUE, marker="o", markersize=6, linewidth=1.8, label="held, 95 % Wilson interval")
    theirs = Line2D([], [], label=f"paper, {title}", **PAPER_MARK)
    return [ours, theirs] if any(method in paper for method in methods) else [ours]


def _label(method: str) -> str:
    return METHODS[method].label.replace("\n", " ") if method in METHODS else method
