"""What a LeRobotDataset v3.0 of grasp attempts looks like: one episode of one frame for each attempt.

::

    meta/info.json, meta/tasks.parquet, meta/stats.json, meta/episodes/chunk-000/file-000.parquet
    data/chunk-000/file-<k>.parquet       one row for each attempt:
        observation.images.<viewpoint>    RGB, PNG
        observation.depth.<viewpoint>     depth in millimetres, TIFF of 32-bit floating-point numbers, every bit kept
        observation.state                 f4 (3,), tool pose of the overhead picture: x [m], y [m], angle [rad]
        action                            f4 (3,), pre-grasp x [m], y [m], angle [rad] in the base frame
        valid.<viewpoint>, valid.action   whether the row has it; a black picture, or zeros, stand in. The state comes
                                          and goes with the overhead picture
        next.reward, next.success, timestamp, frame_index, episode_index, index, task_index
    meta/handsight/origin.json            what LeRobot has no place for: versions, curation,
    meta/handsight/<ulid>.json, .npz      and of every session its attributes and columns, as in schema.py

The pictures of a viewpoint from which no attempt has one are left out, and a flag is there only where some row lacks
what it speaks of: LeRobot batches nothing that is null. The names of depth and flags hold no ``image``: LeRobot 0.4
wants three channels in the statistics of whatever does, and 0.6 wants one in those of depth. Depth is floating-point
because 0.4 shows nothing else, and because LeRobot knows metres and millimetres but no other scale.

LeRobot's own video encoding would quantise depth; pictures in Parquet do not. What lies in ``meta/handsight`` is what
brings every byte back; LeRobot does not read it.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from handsight.datasets.errors import InterchangeError
from handsight.datasets.format.schema import Viewpoint

VERSION = "v3.0"
TASK = "grasp"
EPISODES_PER_FILE = 256
"""About 250 MB of pictures in one data file."""
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
SIDE = "meta/handsight"
PICTURE = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
INTEGERS = ("frame_index", "episode_index", "index", "task_index")


def rgb_key(viewpoint: Viewpoint) -> str:
    """The feature with the colour pictures of a viewpoint."""
    return f"observation.images.{viewpoint}"


def depth_key(viewpoint: Viewpoint) -> str:
    """The feature with the depth pictures of a viewpoint."""
    return f"observation.depth.{viewpoint}"


def valid_key(what: str) -> str:
    """The feature that says whether a row has something."""
    return f"valid.{what}"


def data_file(episode: int) -> str:
    """The file that holds an episode, within the dataset's folder."""
    return DATA.format(chunk_index=0, file_index=episode // EPISODES_PER_FILE)


def flat_name(path: str) -> str:
    """The name of an array inside a ``.npz`` of ``meta/handsight``."""
    return path.replace("/", ".")


def depth_mm_of(depth: NDArray[np.uint16], depth_scale_m: float) -> NDArray[np.float32]:
    """Depth in millimetres, from depth in units of ``depth_scale_m``. Any shape."""
    millimetres: NDArray[np.float32] = depth.astype(np.float32) * np.float32(1e3 * depth_scale_m)
    return millimetres


def depth_of_mm(depth_mm: NDArray[np.float32], depth_scale_m: float) -> NDArray[np.uint16]:
    """What ``depth_mm_of`` was given.

    Raises:
        InterchangeError: It was given nothing that yields these numbers.
    """
    units = np.rint(depth_mm / np.float32(1e3 * depth_scale_m))
    if not np.all((units >= 0) & (units <= np.iinfo(np.uint16).max)):
        raise InterchangeError(f"depth is not within 0 and 65535 units of {depth_scale_m} m everywhere")
    depth: NDArray[np.uint16] = units.astype(np.uint16)
    if not np.array_equal(depth_mm_of(depth, depth_scale_m), depth_mm):
        raise InterchangeError(f"depth is not in whole units of {depth_scale_m} m: it was changed after the export")
    return depth
