"""Panels of success rates with Wilson's 95 % intervals, for the figure of a dataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import blended_transform_factory
from numpy.typing import ArrayLike, NDArray

from handsight.datasets.errors import counted
from handsight.datasets.reading.stats import Histogram, Share, Window
from handsight.evaluation.results import wilson_95
from handsight.viz.figures.style import INK
from handsight.viz.palette import SET_INKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLUE: Final = SET_INKS[0]
GREY: Final = "#6b747f"
GRID: Final = "#d8dde3"
MOST_OBJECTS: Final = 40
"""As many objects are shown each in a row; of more, the best and the worst."""
EXTREME_OBJECTS: Final = 18
LONGEST_NAME: Final = 28
FEWEST_ROWS: Final = 12
"""Few objects stand close together at the top, as if they were so many."""
MOST_BARS: Final = 60
"""More windows than these are a line in a band, which is legible where bars would touch."""
MOST_PARTED_SESSIONS: Final = 40
"""Of more sessions the lines between them would cover the rates."""
RATE_TOP_LEAST: Final = 0.05
COUNTS_AT: Final = 1.1
"""Where the numbers of attempts end, in widths of the panel of objects."""
NOTE: Final[dict[str, Any]] = {"textcoords": "offset points", "fontsize": 7.5, "color": GREY}


def percent(rate: float, digits: int = 1) -> str:
    """A share as it stands in a text: ``11.3 %``."""
    return f"{100 * rate:.{digits}f} %"


def number(count: int) -> str:
    """A count with its thousands apart."""
    return f"{count:,}"


def numbered(count: int, noun: str) -> str:
    """As ``counted``, with thousands apart."""
    return counted(count, noun).replace(str(count), number(count), 1)


def dress(axes: Axes, title: str, note: str = "", *, grid: Literal["x", "y"] | None = None) -> None:
    """Give a panel its title, a note under the title, and the style of all panels."""
    axes.set_title(title, loc="left", fontsize=9.5, fontweight="bold", color=INK, pad=15)
    axes.annotate(note, (0, 1), (0, 5), xycoords="axes fraction", **NOTE)
    axes.spines[["top", "right", "left", "bottom"]].set_visible(False)
    axes.tick_params(length=0, labelsize=8)
    axes.set_axisbelow(True)
    if grid:
        axes.grid(axis=grid, color=GRID, linewidth=0.8)


def say(axes: Axes, text: str) -> None:
    """Put a text in place of what could not be drawn."""
    axes.set_xticks([])
    axes.set_yticks([])
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=GREY)


def intervals(successes: ArrayLike, attempts: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rates, NaN without attempts, and Wilson's intervals for them. (N,), (N,) -> (N,), (2, N)."""
    held, tried = np.asarray(successes, dtype=np.int64), np.asarray(attempts, dtype=np.int64)
    rates = np.divide(held, tried, out=np.full(len(tried), np.nan), where=tried > 0)
    ends = np.array([wilson_95(*pair) for pair in zip(held.tolist(), tried.tolist(), strict=True)])
    return rates, ends.reshape(-1, 2).T


def object_rows(objects: Sequence[Share]) -> list[Share | None]:
    """The objects to show, best first; None stands for those between the best and the worst.

    Of many objects some come out far up or down by luck, those with few attempts above all. So the best are those
    whose interval begins highest, the worst those whose interval ends lowest.
    """

    def by_rate(shares: Sequence[Share]) -> list[Share]:
        return sorted(shares, key=lambda share: (-share.rate, -share.attempts, share.name))

    if len(objects) <= MOST_OBJECTS:
        return list(by_rate(objects))
    ends = {share.name: wilson_95(share.successes, share.attempts) for share in objects}
    best = sorted(objects, key=lambda share: (-ends[share.name][0], share.name))[:EXTREME_OBJECTS]
    rest = [share for share in objects if share not in best]
    worst = sorted(rest, key=lambda share: (ends[share.name][1], share.name))[:EXTREME_OBJECTS]
    return [*by_rate(best), None, *by_rate(worst)]


def draw_objects(axes: Axes, objects: Sequence[Share], overall: float) -> None:
    """One row for each object: its rate and interval, and the number of attempts at the right."""
    shown = object_rows(objects)
    drawn = [(row, share) for row, share in enumerate(shown) if share is not None]
    prefix = _common_folder([share.name for share in objects])
    rates, ends = intervals([share.successes for _, share in drawn], [share.attempts for _, share in drawn])
    note = "95 % Wilson intervals; dashed: all attempts"
    if None in shown:
        note = f"best and worst of {number(len(objects))} by the interval's inner end"
    dress(axes, "Success by object" + (f" ({prefix.rstrip('/')})" if prefix else ""), note, grid="x")
    _draw_overall(axes, overall, upright=True)
    rows = [row for row, _ in drawn]
    axes.errorbar(rates, rows, xerr=_bars(rates, ends), fmt="o", color=BLUE, markersize=3.4, elinewidth=1.1, zorder=3)
    others = f"⋮ {number(len(objects) - len(drawn))} others"
    axes.set_yticks(
        range(len(shown)), [shortened(share.name.removeprefix(prefix)) if share else others for share in shown]
    )
    axes.set_ylim(max(len(shown), FEWEST_ROWS) - 0.4, -0.6)
    _rate_scale(axes, ends[1], along="x")
    beside = blended_transform_factory(axes.transAxes, axes.transData)
    for row, share in drawn:
        count = number(share.attempts)
        axes.text(COUNTS_AT, row, count, transform=beside, ha="right", va="center", fontsize=7, color=GREY)
    axes.annotate("attempts", (COUNTS_AT, 1), (0, 5), xycoords="axes fraction", ha="right", **NOTE)


def draw_angles(axes: Axes, histogram: Histogram, overall: float) -> None:
    """Rate over the grasp angle in degrees, within half a turn."""
    dress(axes, "Success over grasp angle", _points_note(histogram.attempts), grid="y")
    if not sum(histogram.attempts):
        say(axes, "no grasp angle was recorded")
        return
    edges_deg = np.degrees(histogram.edges)
    _draw_points(axes, 0.5 * (edges_deg[:-1] + edges_deg[1:]), histogram.successes, histogram.attempts, overall)
    axes.set_xlim(-90, 90)
    axes.set_xticks(range(-90, 91, 45))
    axes.set_xlabel("closing direction in the base frame [°]")


def draw_contact(axes: Axes, none: Share, histogram: Histogram, overall: float) -> None:
    """Rate over the force that ended the descent: without contact first, then in bins of nearly equal counts."""
    successes, attempts = [none.successes, *histogram.successes], [none.attempts, *histogram.attempts]
    dress(axes, "Success over contact force", _points_note(attempts), grid="y")
    if not sum(attempts):
        say(axes, "no contact force was recorded")
        return
    # Bins between the whole numbers from 0, and what met nothing well apart from them.
    _draw_points(axes, np.array([-1.0, *(np.arange(len(histogram.attempts)) + 0.5)]), successes, attempts, overall)
    axes.set_xlim(-1.6, len(attempts) - 0.8)
    edges = list(histogram.edges)
    names = [f"{edge:.0f}" if edge >= 10 else f"{edge:.1g}" for edge in edges]
    axes.set_xticks([-1, *range(len(edges))], ["none", *names], fontsize=7)
    axes.set_xlabel("force that ended the descent [N]")


def draw_progress(axes: Axes, windows: Sequence[Window], size: int, overall: float) -> None:
    """Rate of window after window, the sessions one after another."""
    ends_at = np.cumsum([window.attempts for window in windows])
    centres = ends_at - 0.5 * np.array([window.attempts for window in windows])
    names = list(dict.fromkeys(window.session for window in windows))
    many = len(names) > 1
    note = f"in windows of about {number(size)} attempts; dashed: all attempts"
    dress(axes, f"Success along the session{'s' * many}", note, grid="y")
    rates, ends = intervals([window.successes for window in windows], [window.attempts for window in windows])
    _draw_overall(axes, overall)
    for place, name in enumerate(names):
        own = np.array([window.session == name for window in windows])
        if place > 0 and len(names) <= MOST_PARTED_SESSIONS:
            axes.axvline(ends_at[np.flatnonzero(own)[0] - 1], color=GREY, linewidth=0.8, zorder=1)
        if len(windows) > MOST_BARS:
            axes.fill_between(centres[own], *ends[:, own], color=BLUE, alpha=0.25, linewidth=0, zorder=2)
            axes.plot(centres[own], rates[own], color=BLUE, linewidth=1.0, zorder=3)
        else:
            bars = _bars(rates[own], ends[:, own])
            axes.errorbar(
                centres[own], rates[own], yerr=bars, fmt="o-", color=BLUE, markersize=3.4, linewidth=1.1, zorder=3
            )
    axes.set_xlim(0, ends_at[-1])
    axes.xaxis.set_major_formatter(lambda count, _: number(round(count)))
    what = f", {number(len(names))} sessions one after another" if many else ""
    axes.set_xlabel(f"labelled attempts{what}")
    _rate_scale(axes, ends[1])


def _draw_points(
    axes: Axes, places: NDArray[np.float64], successes: Sequence[int], attempts: Sequence[int], overall: float
) -> None:
    rates, ends = intervals(successes, attempts)
    some = np.array(attempts) > 0
    _draw_overall(axes, overall)
    axes.errorbar(
        places[some],
        rates[some],
        yerr=_bars(rates, ends)[:, some],
        fmt="o",
        color=BLUE,
        markersize=4,
        elinewidth=1.3,
        zorder=3,
    )
    _rate_scale(axes, ends[1, some])


def _points_note(attempts: Sequence[int]) -> str:
    """How many attempts stand behind a point, where there are any."""
    counts = sorted(count for count in attempts if count)
    if not counts:
        return ""
    span = number(counts[0]) if counts[0] == counts[-1] else f"{number(counts[0])} to {number(counts[-1])}"
    return f"{span} attempt{'s' * (span != '1')} a point"


def _draw_overall(axes: Axes, overall: float, *, upright: bool = False) -> None:
    draw = axes.axvline if upright else axes.axhline
    draw(overall, color=INK, linewidth=1.0, linestyle=(0, (4, 2)), zorder=2)


def _bars(rates: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far intervals reach to either side of the rates. Shape (2, N)."""
    reach: NDArray[np.float64] = np.maximum([rates - ends[0], ends[1] - rates], 0.0)
    return reach


def _rate_scale(axes: Axes, upper: NDArray[np.float64], *, along: Literal["x", "y"] = "y") -> None:
    """A scale in percent from nothing to what the intervals need; never beyond all."""
    top = min(1.0, 1.08 * max(float(upper.max(initial=0.0)), RATE_TOP_LEAST))
    margin = 0.02 * top
    axis = axes.xaxis if along == "x" else axes.yaxis
    (axes.set_xlim if along == "x" else axes.set_ylim)(-margin, top + margin)
    axis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    axis.set_major_formatter(lambda rate, _: f"{round(100 * rate, 3):g} %")


def _common_folder(names: Sequence[str]) -> str:
    """The set that all objects come from, with its slash; empty where they come from several."""
    folders = {name.rpartition("/")[0] for name in names}
    return f"{folders.pop()}/" if len(folders) == 1 and "" not in folders else ""


def shortened(name: str) -> str:
    """A name that fits into the figure: the end of a long one, which says more than its folder."""
    return name if len(name) <= LONGEST_NAME else "…" + name[1 - LONGEST_NAME :]
