"""All figures of an evaluation in one folder, as PNG and SVG."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from handsight.viz.figures.calibration import calibration_figure
from handsight.viz.figures.durations import durations_figure
from handsight.viz.figures.method_table import Source, method_table_figure
from handsight.viz.figures.results import results_figure


def evaluation_figures(results: Mapping[str, Any], folder: Path, *, source: Source = "sim") -> list[Path]:
    """Draw rates, the table in the manner of the paper, moves (figure 9) and calibration, where there is what to draw.

    Args:
        results: What ``evaluate --json`` prints.
        folder: Where to; it is made where it is missing.
        source: Which station was evaluated, and with it which table of the paper stands beside it.

    Returns:
        The files written.

    Raises:
        FigureError: A table cannot be drawn.
        OSError: The folder cannot be made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    if rows := [row for row in results["rows"] if row["trials"]]:
        written += results_figure(rows, folder / "results")
        written += method_table_figure(rows, folder / "table", source=source)
    if results["durations"]:
        written += [durations_figure(results["durations"], folder / f"moves{suffix}") for suffix in (".png", ".svg")]
    if results["calibration"]:
        written += calibration_figure(results["calibration"], folder / "calibration")
    return written
