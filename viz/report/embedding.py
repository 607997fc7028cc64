"""Pictures as parts of a page: bounded in size, and inside it as ``data:`` URIs, so that nothing is fetched."""

from __future__ import annotations

import base64
import io
import re
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from handsight.viz.errors import ReportError

JPEG_QUALITY = 82
MOST_PIXELS = 50_000_000
"""Of a picture that is taken into a report: a larger one is not opened."""
_SVG_SIZE = re.compile(r'<svg[^>]*\bviewBox="0 0 ([0-9.]+) ([0-9.]+)"')


@dataclass(frozen=True, slots=True, kw_only=True)
class Embedded:
    """A picture that is part of a page."""

    media_type: str
    content: bytes
    width_px: int
    height_px: int

    @property
    def uri(self) -> str:
        """The picture as a ``data:`` URI."""
        return f"data:{self.media_type};base64,{base64.b64encode(self.content).decode('ascii')}"


def embedded_svg(draw: Callable[[Path], object]) -> Embedded:
    """A figure as it is drawn into a ``.svg`` file.

    Args:
        draw: Writes the file; may write others beside it.

    Raises:
        ReportError: What was written has no size.
    """
    with tempfile.TemporaryDirectory(prefix="handsight-report-") as folder:
        path = Path(folder) / "figure.svg"
        draw(path)
        text = path.read_text(encoding="utf-8")
    if (found := _SVG_SIZE.search(text)) is None:
        raise ReportError("a figure has no size, expected a viewBox in its SVG")
    width_pt, height_pt = map(float, found.groups())
    # Matplotlib writes points, of which a page has 96 / 72 pixels each.
    return Embedded(
        media_type="image/svg+xml",
        content=text.encode(),
        width_px=round(width_pt * 96 / 72),
        height_px=round(height_pt * 96 / 72),
    )


def embedded_png(draw: Callable[[Path], object]) -> Embedded:
    """A figure of photographs as it is drawn into a ``.png`` file, as JPEG, which takes a fifth of the room."""
    with tempfile.TemporaryDirectory(prefix="handsight-report-") as folder:
        path = Path(folder) / "figure.png"
        draw(path)
        with Image.open(path) as picture:
            return _jpeg(picture.convert("RGB"), picture.width)


def embedded_rgb(rgb: NDArray[np.uint8], *, width_px: int) -> Embedded:
    """A photograph, made smaller where it is wider than ``width_px``. (H, W, 3)."""
    return _jpeg(Image.fromarray(rgb), width_px)


def embedded_file(path: Path, *, width_px: int) -> Embedded:
    """A picture from a file, made smaller where it is wider than ``width_px``.

    Raises:
        ReportError: It is no picture, or one of more than ``MOST_PIXELS``.
    """
    try:
        with (
            warnings.catch_warnings(action="error", category=Image.DecompressionBombWarning),
            Image.open(path) as picture,
        ):
            if picture.width * picture.height > MOST_PIXELS:
                raise ReportError(
                    f"{path} is a picture of {picture.width} x {picture.height} pixels, expected at most "
                    f"{MOST_PIXELS} in all: leave it out, or make it smaller"
                )
            # On white, as figures are drawn: JPEG knows no transparency.
            whole = picture.convert("RGBA")
            ground = Image.new("RGBA", whole.size, "white")
            ground.alpha_composite(whole)
            return _jpeg(ground.convert("RGB"), width_px)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        if isinstance(error, ReportError):
            raise
        raise ReportError(f"{path} is no picture that can be read ({error}): leave it out") from error


def _jpeg(picture: Image.Image, width_px: int) -> Embedded:
    if picture.width > width_px:
        height_px = max(1, round(picture.height * width_px / picture.width))
        picture = picture.resize((width_px, height_px), Image.Resampling.LANCZOS)
    encoded = io.BytesIO()
    picture.save(encoded, "JPEG", quality=JPEG_QUALITY, optimize=True)
    return Embedded(
        media_type="image/jpeg", content=encoded.getvalue(), width_px=picture.width, height_px=picture.height
    )
