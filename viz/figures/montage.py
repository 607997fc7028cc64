"""A strip of examples on a light ground, for documents: what the camera saw, what the network thinks, how far it is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from handsight.viz import palette
from handsight.viz.errors import FigureError
from handsight.viz.examples import HeatmapExample, heatmap_faults
from handsight.viz.figures.pictures import DPI, GAP_PX, WIDTH_PX, draw_jaws, frame_picture
from handsight.viz.figures.style import STYLE, save_png
from handsight.viz.pixels import CENTRE_PX, PictureFrame, best_step, place_heatmap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEFT_MARGIN: Final = 0.035
"""Share of the width for the names of the rows."""
RIGHT_PX: Final = 78
"""For the scales of the colours."""
SCALE_PX: Final = 10
TITLE_PX: Final = 34
ROWS: Final = ("best grasp", "predicted success", "depth")
SCALES: Final = {
    1: (Normalize(0.0, 1.0), "inferno", "S", (0.25, 0.5, 0.75)),
    2: (Normalize(-1e2 * palette.BELOW_TABLE_M, 1e2 * palette.TALLEST_M), "viridis_r", "height [cm]", (-2, 0, 2, 4)),
}
"""Of the rows whose colours mean numbers: range, colours, name and ticks; none at the ends, where scales meet."""


def montage_figure(path: Path, examples: Sequence[HeatmapExample]) -> Path:
    """Draw one column per example: the picture with the best grasp, its heatmap, its depth.

    Args:
        path: The ``.png`` to write.
        examples: Three or four look best; their pictures must have one size.

    Returns:
        The file written, 1200 pixels wide.

    Raises:
        FigureError: No examples, pictures of different sizes, or a heatmap that does not fit; nothing is written then.
    """
    _check(examples)
    k = examples[0].view.camera.intrinsics
    cell_px = (WIDTH_PX * (1 - LEFT_MARGIN) - RIGHT_PX - GAP_PX * len(examples)) / len(examples)
    cell_height_px = cell_px * k.height / k.width
    height_px = round(TITLE_PX + len(ROWS) * (cell_height_px + GAP_PX))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_PX / DPI, height_px / DPI), dpi=DPI, facecolor="white")
        for column, example in enumerate(examples):
            left = LEFT_MARGIN + column * (cell_px + GAP_PX) / WIDTH_PX
            for row, draw in enumerate((_draw_picture, _draw_heat, _draw_depth)):
                top_px = TITLE_PX + row * (cell_height_px + GAP_PX)
                bottom = 1 - (top_px + cell_height_px) / height_px
                axes = figure.add_axes((left, bottom, cell_px / WIDTH_PX, cell_height_px / height_px))
                draw(axes, example)
                _dress(axes, example, first_row=row == 0, name=ROWS[row] if column == 0 else "")
        for row, (norm, colours, label, ticks) in SCALES.items():
            top_px = TITLE_PX + row * (cell_height_px + GAP_PX)
            bottom = 1 - (top_px + cell_height_px) / height_px
            place = (1 - (RIGHT_PX - GAP_PX) / WIDTH_PX, bottom, SCALE_PX / WIDTH_PX, cell_height_px / height_px)
            _draw_scale(figure.add_axes(place), norm, colours, label, ticks)
        return save_png(figure, path)


def _check(examples: Sequence[HeatmapExample]) -> None:
    faults = heatmap_faults(examples)
    sizes = sorted({example.view.depth_m.shape for example in examples})
    if len(sizes) > 1:
        faults.append(f"pictures have sizes {sizes}, expected one")
    if faults:
        raise FigureError("; ".join(faults))


def _draw_picture(axes: Axes, example: HeatmapExample) -> None:
    axes.imshow(example.view.rgb, interpolation="antialiased")
    frame = PictureFrame(camera=example.view.camera, plane_m=example.view.plane_m)
    draw_jaws(axes, frame, best_step(example.heatmap, frame), width_m=example.jaws_m, colour=palette.CHOSEN)


def _draw_heat(axes: Axes, example: HeatmapExample) -> None:
    placement = place_heatmap(example.heatmap)
    rows, columns = example.heatmap.scores.shape
    left_px, top_px = (value - CENTRE_PX for value in placement.translation_px)
    axes.imshow(example.view.rgb, interpolation="antialiased")
    axes.imshow(
        palette.overlay_rgba(example.heatmap.scores),
        extent=(left_px, left_px + columns * placement.scale[0], top_px + rows * placement.scale[1], top_px),
        interpolation="bilinear",
    )
    axes.annotate(
        f"best S {float(np.max(example.heatmap.scores)):.2f}",
        (0, 1),
        xycoords="axes fraction",
        xytext=(4, -4),
        textcoords="offset points",
        va="top",
        fontsize=7,
        color="white",
        bbox={"boxstyle": "round,pad=0.25", "facecolor": "black", "alpha": 0.6, "linewidth": 0},
    )


def _draw_depth(axes: Axes, example: HeatmapExample) -> None:
    view = example.view
    axes.imshow(
        np.where(view.valid, view.depth_m, np.nan),
        cmap="viridis",
        vmin=view.plane_m - palette.TALLEST_M,
        vmax=view.plane_m + palette.BELOW_TABLE_M,
        interpolation="antialiased",
    )


def _draw_scale(axes: Axes, norm: Normalize, colours: str, label: str, ticks: Sequence[float]) -> None:
    bar = axes.figure.colorbar(ScalarMappable(norm, colours), cax=axes)
    bar.outline.set_visible(False)
    bar.set_ticks(list(ticks))
    axes.tick_params(length=0, labelsize=6.5, pad=2)
    axes.set_ylabel(label, fontsize=6.5, labelpad=2)


def _dress(axes: Axes, example: HeatmapExample, *, first_row: bool, name: str) -> None:
    frame_picture(axes, example.view.camera.intrinsics)
    if name:
        axes.set_ylabel(name, fontsize=8, labelpad=5)
    if first_row:
        label = "" if example.held is None else " · held" if example.held else " · empty"
        title = axes.set_title(example.title + label, fontsize=8, pad=5)
        room = axes.get_window_extent().width / title.get_window_extent().width
        title.set_fontsize(8 * min(1.0, room))
