"""What a RealSense D435 makes of an exact depth picture.

A stereo camera measures disparity, so everything happens there: correlated noise of a fraction of a pixel, rounding to
1/32 pixel, no answer in the shadow that near things throw on far ones as seen from the second imager, none along many
depth edges, none nearer than the disparity search reaches. The depth error grows with the square of the distance.

Figures: baseline 50 mm and depth fields of view of the D435 datasheet; disparity search over 126 pixels and error
``z^2 * subpixel / (f * baseline)`` of Intel's white paper on tuning D400 cameras, with a subpixel of 0.05 to 0.15.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

BASELINE_M = 0.05
FOV_X_RAD = math.radians(75)
"""Horizontal field of view of the 640x480 depth mode."""
DISPARITY_STEP_PX = 1 / 32
LARGEST_DISPARITY_PX = 126.0
CORRELATION_PX = 1.5
"""Radius over which neighbouring pixels err alike, since the matcher compares windows."""
EDGE_STEP_PX = 1.0
"""A disparity that changes by more than this between neighbours is an edge."""
EDGE_LOSS = 0.5
"""Share of edge pixels without an answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthNoise:
    """The imperfection of one camera in one attempt."""

    subpixel_px: float
    """Standard deviation of the disparity."""
    seed: int
    """Of the noise."""

    @classmethod
    def draw(cls, rng: np.random.Generator) -> DepthNoise:
        """A camera between a well and a badly tuned one."""
        return cls(subpixel_px=float(rng.uniform(0.05, 0.15)), seed=int(rng.integers(2**32)))

    def measured(self, depth_m: NDArray[np.float64], look: int) -> NDArray[np.float64]:
        """What the camera reports for exact depth, 0 where it has no answer. Shapes (H, W), metres.

        Args:
            depth_m: Exact depth along the optical axis, positive.
            look: Which picture of the attempt it is; each has noise of its own.
        """
        rng = np.random.default_rng([self.seed, look])
        focal_px = 0.5 * depth_m.shape[1] / math.tan(0.5 * FOV_X_RAD)
        disparity_px = (focal_px * BASELINE_M / depth_m).astype(np.float32)
        unanswered = _shadow(disparity_px) | _lost_edges(disparity_px, rng) | (disparity_px > LARGEST_DISPARITY_PX)
        noisy = disparity_px + self.subpixel_px * _correlated(disparity_px.shape, rng)
        steps = np.maximum(np.rint(noisy / DISPARITY_STEP_PX), 1.0).astype(np.float64)
        return np.where(unanswered, 0.0, focal_px * BASELINE_M / (steps * DISPARITY_STEP_PX))


def _shadow(disparity_px: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels that something nearer hides from the second imager, which looks from the right."""
    column_px = np.arange(disparity_px.shape[1], dtype=np.float32) - disparity_px
    # Seen from the right, near things shift left by more: a pixel is hidden where one right of it lands left of it.
    leftmost = np.minimum.accumulate(column_px[:, ::-1], axis=1)[:, ::-1]
    return leftmost < column_px - EDGE_STEP_PX


def _lost_edges(disparity_px: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.bool_]:
    kernel = np.ones((3, 3), np.uint8)
    step_px = cv2.dilate(disparity_px, kernel) - cv2.erode(disparity_px, kernel)
    lost: NDArray[np.bool_] = (step_px > EDGE_STEP_PX) & (rng.random(disparity_px.shape, np.float32) < EDGE_LOSS)
    return lost


def _correlated(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float32]:
    """Smooth noise of deviation 1."""
    white = rng.standard_normal(shape, np.float32)
    smooth = cv2.GaussianBlur(white, (0, 0), CORRELATION_PX)
    # A Gaussian window of deviation s averages 4 pi s^2 pixels.
    return np.asarray(smooth * np.float32(2 * math.sqrt(math.pi) * CORRELATION_PX), dtype=np.float32)
