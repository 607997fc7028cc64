"""The figure of servo durations: how many moves each method took, and how many of those grasps held (figure 9).

One panel for each method and object set. The last bar is the method's limit of moves, at which it grasps whatever it
has found. The same rows give the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from handsight.datasets.errors import counted
from handsight.evaluation.durations import DurationRow
from handsight.servoing.methods.registry import METHODS
from handsight.viz.errors import FigureError
from handsight.viz.figures.rate_panels import GREY, dress, say
from handsight.viz.figures.style import INK, STYLE, check_figure_path, save_png, save_svg
from handsight.viz.palette import MISSED_INK, SET_INKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUFFIXES: Final = (".png", ".svg")
LIMIT_GAP: Final = 0.6
"""By how much the last bar stands apart from the others."""
MOST_TICKS: Final = 11
NUMBER: Final[dict[str, Any]] = {"textcoords": "offset points", "ha": "center", "va": "bottom", "fontsize": 7}


def durations_figure(rows: Sequence[DurationRow], path: Path) -> Path:
    """Draw the trials per number of moves, with the successes among them.

    Args:
        rows: ``durations`` of ``evaluate --json``; methods are rows of panels, object sets columns.
        path: What to write; its suffix, ``.png`` or ``.svg``, says how.

    Returns:
        The file written.

    Raises:
        FigureError: There are no rows, as where no method servoes, or some cannot be drawn; nothing is written then.
    """
    check_figure_path(path, *SUFFIXES)
    _check(rows)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    sets = list(dict.fromkeys(row["objects"] for row in rows))
    with mpl.rc_context(STYLE):
        figure = Figure(
            figsize=(1.0 + 6.2 * len(sets), 0.6 + 2.6 * len(methods)), dpi=150, layout="constrained", facecolor="white"
        )
        panels = figure.subplots(len(methods), len(sets), squeeze=False, sharey="col")
        for method, across in zip(methods, panels, strict=True):
            for objects, axes in zip(sets, across, strict=True):
                chosen = [row for row in rows if (row["method"], row["objects"]) == (method, objects)]
                _draw(axes, chosen, method, objects)
        handles, labels = panels[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=2, frameon=False, fontsize=9)
        return (save_png if path.suffix.lower() == ".png" else save_svg)(figure, path)


def _check(rows: Sequence[DurationRow]) -> None:
    faults = [] if rows else ["there are no rows, expected at least one: evaluate a method that servoes"]
    seen = set()
    for row in rows:
        name = f"{row['method']} on {row['objects']} with {counted(row['moves'], 'move')}"
        if not 0 <= row["successes"] <= row["trials"]:
            faults.append(f"{name} has {row['successes']} of {row['trials']} held, expected 0 <= held <= trials")
        key = row["method"], row["objects"], row["moves"]
        if key in seen:
            faults.append(f"{name} appears twice")
        seen.add(key)
    if faults:
        raise FigureError("; ".join(faults))


def _draw(axes: Axes, rows: Sequence[DurationRow], method: str, objects: str) -> None:
    if not rows:
        dress(axes, _label(method), objects)
        say(axes, "not evaluated")
        return
    centres = [row["moves"] + LIMIT_GAP * row["limit"] for row in rows]
    trials, held = [row["trials"] for row in rows], [row["successes"] for row in rows]
    axes.bar(centres, trials, 0.8, color=MISSED_INK, label="trials", zorder=2)
    axes.bar(centres, held, 0.8, color=SET_INKS[0], label="of them held", zorder=3)
    between = "/" if len(rows) <= MOST_TICKS + 1 else "\nof "
    for centre, count, good in zip(centres, trials, held, strict=True):
        if count:
            axes.annotate(f"{good}{between}{count}", (centre, count), (0, 2), color=INK, zorder=5, **NUMBER)
    total, successes = sum(trials), sum(held)
    dress(axes, _label(method), f"{objects}, n = {total}, {successes} held", grid="y")
    _scale(axes, rows, centres)


def _label(method: str) -> str:
    return METHODS[method].label.replace("\n", " ") if method in METHODS else method


def _scale(axes: Axes, rows: Sequence[DurationRow], centres: Sequence[float]) -> None:
    """Every other number of moves where all would touch, and the limit always."""
    every = -(-len(rows) // MOST_TICKS)
    shown = [
        (centre, f"limit\n{row['moves']}" if row["limit"] else str(row["moves"]))
        for centre, row in zip(centres, rows, strict=True)
        if row["limit"] or (row["moves"] % every == 0 and row["moves"] + every <= rows[-1]["moves"])
    ]
    axes.set_xticks([centre for centre, _ in shown], [label for _, label in shown])
    axes.set_xlim(-0.7, max(centres) + 0.7)
    most = max(row["trials"] for row in rows)
    axes.set_ylim(0, max(axes.get_ylim()[1], 1.25 * most, 1.0))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, integer=True))
    axes.set_xlabel("servo moves before the grasp", fontsize=8, color=GREY)
    axes.set_ylabel("trials", fontsize=8, color=GREY)
