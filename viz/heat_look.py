"""How heat is laid over a picture so that it reads on objects of any colour.

Bright scores are yellow, and so are some objects. Under heat a picture therefore keeps its shapes and little of its
colour: what is vivid is a score. Contours, black under white, show on both.
"""

from __future__ import annotations

import math
from typing import Final

import contourpy
import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.servoing.heatmap import Heatmap
from handsight.viz.palette import OVERLAY_FULL_AT, overlay_rgba

KEPT_COLOUR: Final = 0.15
"""Share of its colour that a picture keeps under heat."""
KEPT_BRIGHTNESS: Final = 0.7
HUE_OPACITY: Final = 0.85
HUE_LIGHTNESS, HUE_CHROMA = 68.0, 48.0
"""Of the colours of angles in CIELAB: all equally light, so that no angle looks better than another."""


def muted(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture as it lies under heat. (H, W, 3) -> (H, W, 3)."""
    grey = rgb.astype(np.float32) @ np.array([0.299, 0.587, 0.114], np.float32)  # (H, W)
    mixed = KEPT_COLOUR * rgb + (1 - KEPT_COLOUR) * grey[..., None]
    return np.rint(KEPT_BRIGHTNESS * mixed).astype(np.uint8)


def shaded_depth(depth_m: NDArray[np.float32], *, near_m: float, far_m: float) -> NDArray[np.uint8]:
    """Depth as grey, the nearer the lighter, black where there is none, to lie under heat. (H, W) -> (H, W, 3)."""
    share = np.clip((far_m - depth_m) / (far_m - near_m), 0, 1)
    valid = np.isfinite(depth_m) & (depth_m > 0)
    grey = np.where(valid, 30 + 190 * share, 0).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def with_heat(rgb: NDArray[np.uint8], scores: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colours under a heatmap of as many points, blended. (R, C, 3), (R, C) -> (R, C, 3)."""
    over = overlay_rgba(scores)
    opacity = over[..., 3:].astype(np.float32) / 255
    return np.rint((1 - opacity) * rgb + opacity * over[..., :3]).astype(np.uint8)


def axial_deg(angle_rad: float) -> int:
    """An angle of equal jaws in whole degrees of half a turn: 0 to 179.

    It is what sliders count in: Rerun 0.41 draws no encoded picture at all at times below zero.
    """
    return round(math.degrees(angle_rad)) % 180


def angle_rgb(angles_rad: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Hues once around the colour wheel in half a turn, after which equal jaws stand as before. (...) -> (..., 3)."""
    hue = 2 * angles_rad
    lab = np.stack(
        [np.full(hue.shape, HUE_LIGHTNESS), HUE_CHROMA * np.cos(hue), HUE_CHROMA * np.sin(hue)], axis=-1
    ).astype(np.float32)
    rgb = cv2.cvtColor(lab.reshape(-1, 1, 3), cv2.COLOR_LAB2RGB)
    colours: NDArray[np.uint8] = np.rint(255 * np.clip(rgb, 0, 1)).astype(np.uint8).reshape(lab.shape)
    return colours


def angle_rgba(angles_rad: NDArray[np.float64], scores: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The same with an opacity that grows with the score there: the angle of a poor grasp is of no interest.

    (R, C), (R, C) -> (R, C, 4).
    """
    opacity = HUE_OPACITY * np.clip(scores / max(OVERLAY_FULL_AT, float(scores.max())), 0.0, 1.0) ** 2
    alpha = np.rint(255 * opacity).astype(np.uint8)
    return np.concatenate([angle_rgb(angles_rad), alpha[..., None]], axis=-1)


def contours(heatmap: Heatmap, level: float) -> list[NDArray[np.float64]]:
    """Lines around where scores reach a level, in raw pixels, pixel centres at whole numbers. Each has shape (N, 2)."""
    generator = contourpy.contour_generator(
        x=heatmap.columns_px.astype(np.float64), y=heatmap.rows_px.astype(np.float64), z=heatmap.scores
    )
    return [np.asarray(line, dtype=np.float64) for line in generator.lines(level)]


def strokes(
    heatmap: Heatmap, angles_rad: NDArray[np.float64], *, least: float, every: int, length_px: float
) -> list[NDArray[np.float64]]:
    """Short lines along the closing direction of the jaws, at every ``every``-th point of at least ``least``.

    Returns:
        Each in raw pixels, shape (2, 2): a second cue beside hue.
    """
    lines = []
    for row in range(every // 2, heatmap.scores.shape[0], every):
        for column in range(every // 2, heatmap.scores.shape[1], every):
            if heatmap.scores[row, column] >= least:
                centre = np.array([heatmap.columns_px[column], heatmap.rows_px[row]], np.float64)
                angle_rad = float(angles_rad[row, column])
                reach = 0.5 * length_px * np.array([math.cos(angle_rad), math.sin(angle_rad)])
                lines.append(np.stack([centre - reach, centre + reach]))
    return lines
