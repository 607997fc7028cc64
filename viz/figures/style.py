"""Fonts and ink of every figure, and how figures are written.

The same content gives the same bytes: files carry neither dates nor versions.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from handsight.datasets.atomic import atomic_file
from handsight.datasets.writable import file_fault
from handsight.viz import palette
from handsight.viz.errors import FigureError

INK: Final = "#22272e"
HATCHES: Final = ("", "//", "..", "xx")
"""Of the bars of object sets, in their order."""


@dataclass(frozen=True, slots=True)
class Series:
    """How one line of a figure is drawn: told from the others by its dash and its marker too."""

    ink: str
    marker: str
    dash: Any

    def line(self) -> dict[str, Any]:
        """Settings of ``Axes.plot``."""
        return {"color": self.ink, "marker": self.marker, "linestyle": self.dash, "markersize": 5}


SERIES: Final = tuple(
    Series(*parts)
    for parts in zip(
        palette.SERIES_INKS,
        ("o", "s", "^", "D", "v", "P"),
        ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)), (0, (3, 1)), (0, (8, 2))),
        strict=True,
    )
)

STYLE: Final[dict[Any, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    # Text stays text, so that an SVG can be searched; ids are drawn from the content, not at random.
    "svg.fonttype": "none",
    "svg.hashsalt": "handsight",
}


def save_figure(figure: Figure, path: Path) -> tuple[Path, Path]:
    """Write a figure as ``.png`` and ``.svg``, without dates and versions.

    Raises:
        FigureError: The folder does not exist.
    """
    return save_png(figure, path.with_suffix(".png")), save_svg(figure, path.with_suffix(".svg"))


def save_png(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, without dates and versions.

    Raises:
        FigureError: The folder does not exist.
    """
    check_figure_path(path)
    FigureCanvasAgg(figure)
    with atomic_file(path) as unfinished:
        figure.savefig(unfinished, format="png", metadata={"Software": None})
    return path


def save_svg(figure: Figure, path: Path) -> Path:
    """Write a figure as SVG, without dates and versions.

    Raises:
        FigureError: The folder does not exist.
    """
    check_figure_path(path)
    with atomic_file(path) as unfinished:
        figure.savefig(unfinished, format="svg", metadata={"Date": None, "Creator": None})
    return path


def check_figure_path(path: Path, *suffixes: str) -> None:
    """Refuse a place where no figure can be written, before it is made.

    Raises:
        FigureError: The folder does not exist or takes no new files, a folder is there, or the name ends in none of
            the suffixes, if any are given.
    """
    if (fault := file_fault(path)) is not None:
        raise FigureError(f"cannot write a figure to {str(path)!r}: {fault}; choose another file")
    if suffixes and path.suffix.lower() not in suffixes:
        raise FigureError(
            f"cannot write a figure to {str(path)!r}, expected a name that ends in {' or '.join(suffixes)}"
        )
