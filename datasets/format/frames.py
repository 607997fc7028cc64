"""What a picture is in the arrays of a session (colours, depth, pose), read back and encoded.

Encoding turns pictures into the bytes that the store is to hold, before there is a transaction to write them to.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.abc.buffer import Buffer
from zarr.storage import MemoryStore

from handsight.datasets.format.arrays import (
    Arrays,
    Layouts,
    array_at,
    arrays_with,
    overwrite,
    read_range,
    run_concurrently,
)
from handsight.datasets.format.schema import VIEWPOINTS, Viewpoint
from handsight.datasets.records import RgbdFrame

EncodedFrames = dict[str, Buffer]
"""One chunk for each array of pictures, by its path in the session's group; none where all values are fill values."""

BATCH_FRAMES = 16
"""Pictures of one viewpoint that are decoded together, about 25 MB at 640x480."""


def frame_paths() -> list[str]:
    """Paths, in a session's group, of the arrays of pictures."""
    return [f"{viewpoint}/{name}" for viewpoint in VIEWPOINTS for name in ("rgb", "depth")]


def frame_arrays(group: zarr.Group, viewpoint: Viewpoint) -> Arrays:
    """What :func:`read_frames` needs of a session's group.

    Raises:
        CorruptDataError: An array is missing or damaged.
    """
    paths = (f"{viewpoint}/{name}" for name in ("rgb", "depth", "pose_base_tool"))
    return {path: array_at(group, path) for path in paths}


def read_frames(
    arrays: Arrays, viewpoint: Viewpoint, start: int, stop: int, *, poses: NDArray[np.float64] | None = None
) -> list[RgbdFrame]:
    """The pictures of neighbouring attempts of a session; black, with NaN for a pose, where none was taken.

    Args:
        arrays: Those of the viewpoint, by path in the session's group; others may be among them.
        viewpoint: Where the pictures were taken from.
        start: Number of the first attempt.
        stop: The number after the last.
        poses: Where the tool was for each of them, if that was read already. Shape (stop - start, 4, 4).

    Raises:
        CorruptDataError: Their bytes are damaged or missing, or an array ends before.
    """
    rgb, depth = (read_range(arrays[f"{viewpoint}/{name}"], start, stop) for name in ("rgb", "depth"))
    if poses is None:
        poses = read_range(arrays[f"{viewpoint}/pose_base_tool"], start, stop)
    triples = zip(rgb, depth, poses, strict=True)
    return [RgbdFrame(rgb=colours, depth=raw, pose_base_tool=pose) for colours, raw, pose in triples]


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
