"""What a foreign set looks like to the import, whatever holds it: episodes of frames, with columns and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import InterchangeError
from handsight.datasets.exchange.mapped.map_file import Frame

MOST_FRAMES = 1_000_000
"""In one episode: hours of recording. A file must not have memory set aside for whatever it claims."""


class EpisodeSet(Protocol):
    """A set of episodes, open for reading. Every error is an InterchangeError that names the column."""

    @property
    def format(self) -> str:
        """What it is, for the header of the session."""
        ...

    @property
    def names(self) -> Sequence[str]:
        """How each episode is called."""
        ...

    def faults(self, *, numbers: Sequence[str], pictures: Sequence[str]) -> list[str]:
        """What keeps these columns from being read, before any is."""
        ...

    def depth_unit_m(self, column: str) -> float | None:
        """Metres in one unit of a depth column, where the set itself says so."""
        ...

    def values(self, episode: int, column: str) -> NDArray[Any]:
        """A column of an episode. Shape (T,) or (T, K); of one value for the whole episode, (1,) or (1, K)."""
        ...

    def picture(self, episode: int, column: str, frame: int) -> NDArray[Any]:
        """One picture. Shape (H, W), (H, W, 1) or (H, W, 3)."""
        ...


def frame_number(frame: Frame, length: int, heights: NDArray[np.float64] | None = None) -> int:
    """Which frame of ``length`` is meant; ``heights`` of shape (length,) for ``lowest``.

    Raises:
        InterchangeError: There is no such frame.
    """
    if length < 1:
        raise InterchangeError("the episode has no frames")
    if frame == "lowest" and heights is not None:
        return int(np.argmin(heights))
    number = {"first": 0, "last": length - 1}.get(frame, 0) if isinstance(frame, str) else frame
    if not -length <= number < length:
        raise InterchangeError(f"frame {number} is asked for, and there are {length}")
    return number % length


def as_rgb(picture: NDArray[Any], column: str) -> NDArray[np.uint8]:
    """A colour picture, shape (H, W, 3).

    Raises:
        InterchangeError: It is something else.
    """
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
        raise InterchangeError(f"{column} is {picture.dtype} {picture.shape}, expected three 8-bit colours")
    return np.ascontiguousarray(picture)


def as_depth(picture: NDArray[Any], column: str, unit_m: float, scale_m: float) -> NDArray[np.uint16]:
    """Depth in units of ``scale_m``, shape (H, W), from one in units of ``unit_m``; what it cannot hold becomes 0.

    Raises:
        InterchangeError: It is something else.
    """
    flat = picture[..., 0] if picture.ndim == 3 and picture.shape[2] == 1 else picture
    if flat.ndim != 2 or flat.dtype.kind not in "uif" or flat.dtype == np.uint8:
        raise InterchangeError(f"{column} is {picture.dtype} {picture.shape}, expected one channel of more than 8 bits")
    if flat.dtype == np.uint16 and unit_m == scale_m:
        return np.ascontiguousarray(flat)
    with np.errstate(all="ignore"):  # What is no number, or too large for one, becomes 0 below.
        units = np.rint(flat.astype(np.float64) * (unit_m / scale_m))
    return np.where((units >= 0) & (units <= np.iinfo(np.uint16).max), units, 0).astype(np.uint16)
