"""Predicted against happened, over many attempts: the first tab of a recording of heatmaps.

overview/{sheet, reliability, list}     pictures of the most wrong attempts; how often grasps held by score; a table
"""

from __future__ import annotations

import io
from typing import Final

import cv2
import matplotlib as mpl
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from handsight.datasets.errors import counted
from handsight.viz import palette
from handsight.viz.examples import ForesightOverview
from handsight.viz.recordings.encoding import encoded_png, jpeg
from handsight.viz.recordings.layouts import BACKGROUND, picture_bounds

ROOT: Final = "/overview"
COLUMNS: Final = 4
LISTED: Final = 60
CAPTION_PX: Final = 22
"""Height of the line under each picture of the sheet."""
PLOT_PX: Final = (760, 560)
_DPI = 100
_GROUND = (BACKGROUND[0] / 255, BACKGROUND[1] / 255, BACKGROUND[2] / 255)
_INK = (0.92, 0.92, 0.92)


def log_overview(stream: rr.RecordingStream, overview: ForesightOverview) -> None:
    """Log the overview, for all angles."""
    stream.log(f"{ROOT}/sheet", jpeg(_sheet(overview)), static=True)
    stream.log(f"{ROOT}/reliability", encoded_png(_reliability(overview)), static=True)
    stream.log(f"{ROOT}/list", rr.TextDocument(_table(overview), media_type="text/markdown"), static=True)


def overview_layout(overview: ForesightOverview) -> rrb.Container:
    """The sheet on the left; curve and list on the right."""
    height_px, width_px = _sheet(overview).shape[:2]
    return rrb.Horizontal(
        rrb.Spatial2DView(
            name="Where the network is most wrong",
            origin=f"{ROOT}/sheet",
            background=BACKGROUND,
            visual_bounds=picture_bounds(width_px, height_px),
        ),
        rrb.Vertical(
            rrb.Spatial2DView(
                name="Predicted against happened",
                origin=f"{ROOT}/reliability",
                background=BACKGROUND,
                visual_bounds=picture_bounds(*PLOT_PX),
            ),
            rrb.TextDocumentView(name="Most wrong first", origin=f"{ROOT}/list"),
            row_shares=[0.55, 0.45],
        ),
        column_shares=[0.6, 0.4],
        name="Predicted and happened",
    )


def _sheet(overview: ForesightOverview) -> NDArray[np.uint8]:
    """Thumbnails in rows, each with a caption and a border in the colour of what happened. (H, W, 3)."""
    height_px, width_px = overview.thumbnails[0].shape[:2]
    count = len(overview.thumbnails)
    columns, rows = min(COLUMNS, count), -(-count // COLUMNS)
    cell_px = (width_px + 8, height_px + CAPTION_PX + 8)
    sheet = np.full((rows * cell_px[1], columns * cell_px[0], 3), BACKGROUND, np.uint8)
    for at, (thumbnail, one) in enumerate(zip(overview.thumbnails, overview.wrong, strict=False)):
        row, column = divmod(at, COLUMNS)
        x_px, y_px = column * cell_px[0] + 4, row * cell_px[1] + 4
        sheet[y_px : y_px + height_px, x_px : x_px + width_px] = thumbnail
        colour = palette.HELD if one.held else palette.EMPTY
        cv2.rectangle(sheet, (x_px, y_px), (x_px + width_px - 1, y_px + height_px - 1), colour, 2)
        what = f"{at + 1}. {one.target.rpartition('/')[2]}: S {one.score:.2f}, {'held' if one.held else 'empty'}"
        place = (x_px + 2, y_px + height_px + 16)
        cv2.putText(sheet, what, place, cv2.FONT_HERSHEY_SIMPLEX, 0.42, (235, 235, 235), 1, cv2.LINE_AA)
    return sheet


def _reliability(overview: ForesightOverview) -> bytes:
    """How often grasps held, by predicted success, with intervals and counts: a PNG."""
    rows = overview.reliability
    with mpl.rc_context({"font.family": "DejaVu Sans", "font.size": 11, "text.color": _INK, "axes.labelcolor": _INK}):
        figure = Figure(figsize=(PLOT_PX[0] / _DPI, PLOT_PX[1] / _DPI), dpi=_DPI, facecolor=_GROUND)
        axes = figure.add_axes((0.1, 0.12, 0.86, 0.78), facecolor=_GROUND)
        axes.plot([0, 1], [0, 1], linestyle="--", color="#888888", linewidth=1, label="as predicted")
        colour = tuple(value / 255 for value in palette.CHOSEN)
        for row in rows:
            axes.plot([row["mean_score"]] * 2, row["ci95"], color=colour, linewidth=2)
            # Beside the point, not on its interval.
            axes.annotate(
                f"n {row['attempts']}",
                (row["mean_score"], row["rate"]),
                xytext=(7, -4),
                textcoords="offset points",
                fontsize=9,
                color=_INK,
            )
        axes.plot(
            [row["mean_score"] for row in rows],
            [row["rate"] for row in rows],
            marker="o",
            color=colour,
            linewidth=1.5,
            label="held, with 95 % intervals",
        )
        axes.set(xlim=(-0.02, 1.06), ylim=(-0.03, 1.03), xlabel="predicted success S", ylabel="share that held")
        axes.set_title(f"{_compared(overview)}; S {_kind(overview)}", color=_INK, fontsize=11)
        axes.tick_params(colors=_INK)
        for spine in axes.spines.values():
            spine.set_edgecolor("#666666")
        legend = axes.legend(loc="upper left", frameon=False)
        for text in legend.get_texts():
            text.set_color(_INK)
        contents = io.BytesIO()
        figure.savefig(contents, format="png", dpi=_DPI)
    return contents.getvalue()


def _compared(overview: ForesightOverview) -> str:
    """How many, and how many of them say little because the network learnt from them."""
    what = counted(overview.attempts, "attempt")
    if overview.learnt is None:
        return f"{what}, some of them perhaps learnt from"
    return f"{what}, {overview.learnt} of them learnt from" if overview.learnt else f"{what}, none learnt from"


def _kind(overview: ForesightOverview) -> str:
    return "calibrated" if overview.temperature.fitted else "as the network gives it"


def _table(overview: ForesightOverview) -> str:
    lines = [
        f"## {overview.title}",
        "",
        f"{_compared(overview)}. Shown: {overview.temperature}.",
        "",
        "| rank | attempt | target | S | happened |",
        "|--:|:--|:--|--:|:--|",
    ]
    lines += [
        f"| {rank} | {one.attempt} | {one.target or '—'} | {one.score:.3f} | {'held' if one.held else 'empty'} |"
        for rank, one in enumerate(overview.wrong[:LISTED], start=1)
    ]
    if overview.attempts > LISTED:
        lines += ["", f"The other {overview.attempts - LISTED} surprise less."]
    return "\n".join(lines) + "\n"
