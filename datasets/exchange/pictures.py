"""Pictures as encoded bytes: written without loss, and read only at the size that is expected."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from handsight.datasets.errors import InterchangeError, headline
from handsight.datasets.machine import of_the_machine

_FORMATS = ("PNG", "TIFF", "JPEG", "WEBP")
_MOST_PIXELS = 8192 * 8192
_LZW, _FLOATING_POINT = 5, 3
"""TIFF's numbers of a compression and of what is done before it; deflate is an eighth of it smaller, and six times as
slow."""


def png(picture: NDArray[np.uint8]) -> bytes:
    """An RGB picture, shape (H, W, 3), as PNG."""
    return cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes()


def tiff(picture: NDArray[np.float32]) -> bytes:
    """A picture of 32-bit floating-point numbers, shape (H, W), as TIFF."""
    how = [cv2.IMWRITE_TIFF_COMPRESSION, _LZW, cv2.IMWRITE_TIFF_PREDICTOR, _FLOATING_POINT]
    return cv2.imencode(".tiff", picture, how)[1].tobytes()


def decoded(data: bytes, *, size: tuple[int, int] | None = None, most_pixels: int = _MOST_PIXELS) -> NDArray[Any]:
    """The picture in some bytes, with all its bits: (H, W, 3) of uint8 or (H, W) of uint8, uint16 or float32.

    Args:
        data: PNG, TIFF, JPEG or WebP.
        size: Height and width that it must have; None for any up to ``most_pixels``.
        most_pixels: The size is looked at before memory is set aside: a few bytes suffice to claim any.

    Raises:
        InterchangeError: It cannot be decoded, or has another size.
    """
    with examined(data, "a picture", formats=_FORMATS, size=size, most_pixels=most_pixels) as image:
        return np.asarray(image.convert("RGB") if image.mode in ("RGBA", "P", "CMYK", "YCbCr") else image)


@contextmanager
def examined(
    data: bytes, name: str, *, formats: tuple[str, ...], size: tuple[int, int] | None, most_pixels: int = _MOST_PIXELS
) -> Iterator[Image.Image]:
    """A picture whose size has been looked at, and nothing decoded yet.

    Args:
        data: The file.
        name: What to call it.
        formats: Pillow's names of those that are read.
        size: Height and width that it must have [px]; None for any up to ``most_pixels``.
        most_pixels: The largest that is decoded where any size will do.

    Raises:
        InterchangeError: It is no picture, or has another size; also where the block cannot decode it.
    """
    try:
        # A warning about damage says no more than the error that follows, or than the pixels that are there.
        with warnings.catch_warnings(action="ignore"), Image.open(io.BytesIO(data), formats=formats) as image:
            width, height = image.size
            if size is not None and (height, width) != size:
                raise InterchangeError(f"{name} has {width}x{height} pixels, expected {size[1]}x{size[0]}")
            if width * height > most_pixels:
                raise InterchangeError(f"{name} claims {width}x{height} pixels, expected at most {most_pixels}")
            yield image
    except InterchangeError:
        raise
    except Exception as error:  # Pillow's readers raise whatever their parsing of damaged bytes happens to.
        if trouble := of_the_machine(f"{name} cannot be decoded", error):
            raise trouble from error
        raise InterchangeError(
            f"{name} cannot be decoded ({headline(error)}), expected an undamaged file of {', '.join(formats)}"
        ) from error
