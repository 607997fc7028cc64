"""Pictures turned into the bytes that the store is to hold, before there is a change to write them to."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from zarr.abc.buffer import Buffer
from zarr.storage import MemoryStore

from handsight.datasets.format.arrays import Layouts, arrays_with, overwrite, run_concurrently
from handsight.datasets.format.schema import VIEWPOINTS, Viewpoint
from handsight.datasets.records import RgbdFrame

EncodedFrames = dict[str, Buffer]
"""One chunk for each array of pictures, by its path in the session's group; none where all values are fill values."""


def frame_paths() -> list[str]:
    """Paths, in a session's group, of the arrays of pictures."""
    return [f"{viewpoint}/{name}" for viewpoint in VIEWPOINTS for name in ("rgb", "depth")]


class FrameEncoder:
    """Encodes the pictures of one attempt after the other as the arrays of a session store them.

    Compressing is most of what writing an attempt takes. Done as soon as there is an attempt, it does not hold up the
    commit, and what waits for that takes a third of the memory.
    """

    def __init__(self, layouts: Layouts) -> None:
        self._one_row = {path: layouts[path].update_shape((1, *layouts[path].shape[1:])) for path in frame_paths()}

    def encode(self, frames: Mapping[Viewpoint, RgbdFrame | None]) -> EncodedFrames:
        """The chunks of one attempt. The pictures are not needed any more afterwards."""
        chunks: dict[str, Buffer] = {}
        arrays = arrays_with(self._one_row, MemoryStore(chunks))
        run_concurrently(overwrite(arrays[path], 0, frame[None]) for path, frame in _frames(frames).items())
        return {key.partition("/c/")[0]: chunk for key, chunk in chunks.items()}


def _frames(frames: Mapping[Viewpoint, RgbdFrame | None]) -> dict[str, NDArray[np.generic]]:
    arrays: dict[str, NDArray[np.generic]] = {}
    for viewpoint, frame in frames.items():
        if frame is not None:
            arrays |= {f"{viewpoint}/rgb": frame.rgb, f"{viewpoint}/depth": frame.depth}
    return arrays
