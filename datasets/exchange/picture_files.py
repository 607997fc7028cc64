"""Picture files of anybody's, looked at before they are decoded: none has more memory set aside than its due.

Pillow reads what a file claims and, of PNG, every checksum; OpenCV decodes it with all its bits.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import InterchangeError
from handsight.datasets.exchange.pictures import examined
from handsight.datasets.machine import of_the_machine

_FORMATS = ("PNG", "TIFF", "PPM", "BMP", "WEBP", "JPEG2000", "JPEG")
"""What both libraries read. Whether a file of the last three is lossless, only its owner knows."""

_MOST_BYTES_A_PIXEL = 16
_MOST_BYTES_BESIDE = 2**24
"""Largest file for a picture: more than any encoding takes, and what cameras write beside the pixels."""


def read_colours(folder: Path, name: str, size: tuple[int, int]) -> NDArray[np.uint8]:
    """A colour picture, as RGB of shape (H, W, 3).

    Args:
        folder: Where pictures are.
        name: The file's path in it.
        size: Height and width that it must have [px].

    Raises:
        InterchangeError: It is not in the folder, damaged, or another kind of picture.
    """
    colours = _picture(folder, name, size)
    if colours.dtype != np.uint8 or colours.shape != (*size, 3):
        raise InterchangeError(f"picture {name!r} is {_kind(colours)}, expected three 8-bit colours")
    return np.asarray(cv2.cvtColor(colours, cv2.COLOR_BGR2RGB), np.uint8)


def read_depth(folder: Path, name: str, size: tuple[int, int]) -> NDArray[np.uint16]:
    """A depth picture, shape (H, W); arguments and errors as for :func:`read_colours`."""
    depth = _picture(folder, name, size)
    if depth.dtype != np.uint16 or depth.shape != size:
        raise InterchangeError(
            f"picture {name!r} is {_kind(depth)}, expected one 16-bit channel, in units of depth_scale_m"
        )
    return np.asarray(depth, np.uint16)


def _picture(folder: Path, name: str, size: tuple[int, int]) -> NDArray[Any]:
    """A picture inside the folder, with all its bits."""
    data = _content(folder, name, size)
    with examined(data, f"picture {name!r}", formats=_FORMATS, size=size) as claimed:
        claimed.verify()
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        if trouble := of_the_machine(f"picture {name!r} cannot be decoded", error):
            raise trouble from error
        raise InterchangeError(f"picture {name!r} cannot be decoded: {error.err or error}") from error
    if picture is None:
        raise InterchangeError(f"picture {name!r} cannot be decoded: take an undamaged copy")
    return np.asarray(picture)


def _content(folder: Path, name: str, size: tuple[int, int]) -> bytes:
    most = _MOST_BYTES_A_PIXEL * size[0] * size[1] + _MOST_BYTES_BESIDE
    try:
        path = folder / name
        if not name or Path(name).is_absolute() or not path.resolve().is_relative_to(folder.resolve()):
            raise InterchangeError(f"picture {name!r} is not in the folder, expected a relative path, no links")
        if not path.is_file() or not path.stat().st_size:
            raise InterchangeError(f"picture {name!r} does not exist or is empty")
        if path.stat().st_size > most:
            raise InterchangeError(f"picture {name!r} takes {path.stat().st_size} bytes, expected at most {most}")
        return path.read_bytes()
    except (OSError, ValueError, RuntimeError) as error:
        if isinstance(error, InterchangeError):
            raise
        if trouble := of_the_machine(f"picture {name[:80]!r} cannot be read", error):
            raise trouble from error
        # A name with a NUL or beyond the length of names, links in a circle, rights.
        raise InterchangeError(
            f"picture {name[:80]!r} cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from error


def _kind(picture: NDArray[Any]) -> str:
    transparent = picture.ndim == 3 and picture.shape[2] in (2, 4)
    return f"{picture.dtype} {picture.shape}{', with transparency' * transparent}"
