"""Colour scales, drawn as pictures to stand under the views whose colours they explain."""

from __future__ import annotations

import io
import math

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from handsight.viz import palette
from handsight.viz.heat_look import angle_rgb

HEIGHT_PX = 60
"""Of a scale, in pixels of the picture that it stands under."""
_DPI = 100
_GROUND = (18 / 255, 20 / 255, 24 / 255)
_INK = (0.92, 0.92, 0.92)


def score_scale(width_px: int, *, name: str, threshold: float) -> bytes:
    """Colours of predicted success from 0 to 1, with the threshold as a line: a PNG, HEIGHT_PX high."""
    colours = palette.score_rgb(np.linspace(0, 1, 256))[None]
    ticks = {value: f"{value:g}" for value in (0.0, 0.25, 0.5, 0.75, 1.0)}
    return _strip(width_px, colours, (0.0, 1.0), ticks, name=name, mark=threshold)


def angle_scale(width_px: int, *, name: str) -> bytes:
    """Colours of angles over half a turn: a PNG, HEIGHT_PX high."""
    colours = angle_rgb(np.radians(np.linspace(0, 180, 256)))[None]
    ticks = {float(value): f"{value}°" for value in (0, 45, 90, 135, 180)}
    return _strip(width_px, colours, (0.0, 180.0), ticks, name=name, mark=math.nan)


def _strip(
    width_px: int,
    colours: NDArray[np.uint8],
    ends: tuple[float, float],
    ticks: dict[float, str],
    *,
    name: str,
    mark: float,
) -> bytes:
    with mpl.rc_context({"font.family": "DejaVu Sans", "font.size": 10}):
        figure = Figure(figsize=(width_px / _DPI, HEIGHT_PX / _DPI), dpi=_DPI, facecolor=_GROUND)
        axes = figure.add_axes((0.04, 0.34, 0.92, 0.24))
        axes.imshow(colours, extent=(*ends, 0, 1), aspect="auto", interpolation="nearest")
        axes.set_xticks(list(ticks), list(ticks.values()))
        axes.set_yticks([])
        axes.tick_params(colors=_INK, length=2, pad=1)
        for spine in axes.spines.values():
            spine.set_edgecolor(_INK)
        axes.set_title(name, color=_INK, fontsize=10, pad=2)
        if math.isfinite(mark):
            axes.axvline(mark, color="black", linewidth=4)
            axes.axvline(mark, color="white", linewidth=1.6)
        contents = io.BytesIO()
        figure.savefig(contents, format="png", dpi=_DPI)
    return contents.getvalue()
