"""Pictures as Rerun keeps them: JPEG for colour, PNG for whatever must come back exactly.

Raw frames make a trace ten times larger. Base and overlay must both be encoded: Rerun draws a raw RGBA image over an
encoded one opaque.
"""

from __future__ import annotations

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from handsight.servoing.heatmap import Heatmap
from handsight.viz.errors import RecordingError
from handsight.viz.palette import overlay_rgba
from handsight.viz.pixels import place_heatmap

JPEG_QUALITY = 85
DEPTH_UNIT_M = 0.001
"""Unit of encoded depth where the camera's own is not known [m]."""
MOST_DIFFERENCE = 0.25
"""Difference of colours at which the colours that show it end; black and white differ by 1."""
SCORE_UNITS = 65535.0
"""Of encoded scores from 0 to 1."""
OVERLAY_ORDER = 10.0
"""Draw order of heatmaps: over the picture, under every mark."""


def jpeg(rgb: NDArray[np.uint8], *, draw_order: float | None = None) -> rr.EncodedImage:
    """A colour picture (H, W, 3), slightly lossy."""
    contents = _encode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return rr.EncodedImage(contents=contents, media_type="image/jpeg", draw_order=draw_order)


def png(pixels: NDArray[np.uint8], *, draw_order: float | None = None) -> rr.EncodedImage:
    """A small colour picture (H, W, 3), or one with opacity (H, W, 4), exactly. Enlarged, it shows its pixels."""
    code = cv2.COLOR_RGBA2BGRA if pixels.shape[2] == 4 else cv2.COLOR_RGB2BGR
    contents = _encode(".png", cv2.cvtColor(pixels, code))
    return rr.EncodedImage(
        contents=contents, media_type="image/png", draw_order=draw_order, magnification_filter="Nearest"
    )


def encoded_png(contents: bytes) -> rr.EncodedImage:
    """A picture that is a PNG already."""
    return rr.EncodedImage(contents=contents, media_type="image/png")


def depth_png(depth_m: NDArray[np.float32], *, unit_m: float, range_m: tuple[float, float]) -> rr.EncodedDepthImage:
    """Depth (H, W) in whole units of ``unit_m``, exact to half a unit; invalid pixels become 0."""
    valid = np.isfinite(depth_m) & (depth_m > 0)
    units = np.clip(np.rint(np.where(valid, depth_m, 0.0) / unit_m), 0, np.iinfo(np.uint16).max).astype(np.uint16)
    near_m, far_m = range_m
    return rr.EncodedDepthImage(
        _encode(".png", units),
        media_type="image/png",
        meter=1.0 / unit_m,
        colormap="Viridis",
        depth_range=(near_m / unit_m, far_m / unit_m),
    )


def height_image(inputs_depth_m: NDArray[np.float32], *, top_m: float) -> rr.DepthImage:
    """The depth channel of a network input (size, size), drawn as height above the mean plane from 0 to ``top_m``."""
    return rr.DepthImage(
        np.maximum(-inputs_depth_m, 0.0),
        meter=1.0,
        colormap="Viridis",
        depth_range=(0.0, top_m),
        magnification_filter="Nearest",
    )


def difference_image(difference: NDArray[np.float32]) -> rr.DepthImage:
    """How much two pictures differ, from 0 to 1. (size, size)."""
    return rr.DepthImage(
        np.asarray(difference, dtype=np.float32),
        meter=1.0,
        colormap="Inferno",
        depth_range=(0.0, MOST_DIFFERENCE),
        magnification_filter="Nearest",
    )


def scores_png(scores: NDArray[np.float32]) -> rr.EncodedDepthImage:
    """Scores in [0, 1] as numbers of 16 bits, exact to 1e-5; hovering over one tells it. (R, C)."""
    units = np.rint(np.clip(scores, 0, 1) * SCORE_UNITS).astype(np.uint16)
    return rr.EncodedDepthImage(
        _encode(".png", units),
        media_type="image/png",
        meter=SCORE_UNITS,
        colormap="Inferno",
        depth_range=(0.0, SCORE_UNITS),
        magnification_filter="Nearest",
    )


def log_overlay(recording: rr.RecordingStream, path: str, heatmap: Heatmap, *, static: bool = False) -> None:
    """Log a heatmap so that every cell lies on the raw pixel that it scores; low scores let the picture through."""
    log_placed(recording, path, heatmap, png(overlay_rgba(heatmap.scores), draw_order=OVERLAY_ORDER), static=static)


def log_placed(
    recording: rr.RecordingStream, path: str, heatmap: Heatmap, image: rr.EncodedImage, *, static: bool = False
) -> None:
    """Log an image with a pixel for each point of a heatmap, over the raw picture."""
    placement = place_heatmap(heatmap)
    recording.log(path, image, static=static)
    recording.log(
        path,
        rr.Transform3D(translation=(*placement.translation_px, 0.0), scale=(*placement.scale, 1.0)),
        static=static,
    )


def _encode(suffix: str, pixels: NDArray[np.integer | np.floating], parameters: list[int] | None = None) -> bytes:
    done, buffer = cv2.imencode(suffix, pixels, parameters or [])
    if not done:
        raise RecordingError(f"a picture of shape {pixels.shape} and type {pixels.dtype} has no {suffix} encoding")
    return bytes(buffer)
