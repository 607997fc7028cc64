"""Colours as people see them: CIELAB distances with all three kinds of cones, and without the red or the green ones."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

# Machado, Oliveira and Fernandes (2009), A physiologically-based model for simulation of color vision deficiency,
# severity 1.0; they act on linear RGB.
SEEN_WITH: Final = {
    "all cones": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}
# IEC 61966-2-1: linear sRGB to CIE XYZ, and its white, D65.
XYZ_FROM_RGB: Final = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE: Final = np.array([0.95047, 1.0, 1.08883])

Colour = str | tuple[int, int, int]


def linear(colour: Colour) -> NDArray[np.float64]:
    """Linear RGB of ``#rrggbb`` or of three bytes. Shape (3,)."""
    if isinstance(colour, str):
        colour = (int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16))
    share = np.array(colour) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def lab(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """CIELAB of linear RGB. (3,) -> (3,)."""
    relative = XYZ_FROM_RGB @ np.clip(rgb, 0, 1) / WHITE
    f = np.where(relative > 216 / 24389, np.cbrt(relative), (24389 / 27 * relative + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def distances(one: Colour, other: Colour) -> dict[str, float]:
    """How far two colours are apart in CIELAB (1976), for each way of seeing."""
    return {
        seeing: float(np.linalg.norm(lab(matrix @ linear(one)) - lab(matrix @ linear(other))))
        for seeing, matrix in SEEN_WITH.items()
    }


def contrast(one: Colour, other: Colour) -> float:
    """Contrast of two colours as WCAG 2 defines it, from 1 to 21."""
    darker, lighter = sorted(float(XYZ_FROM_RGB[1] @ linear(colour)) for colour in (one, other))
    return (lighter + 0.05) / (darker + 0.05)
