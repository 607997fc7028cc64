"""Attempts as rows of a LeRobotDataset, and the statistics of what went into them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from handsight.datasets.exchange.lerobot_layout import depth_key, depth_mm_of, rgb_key, valid_key
from handsight.datasets.exchange.lerobot_statistics import NumberStatistics, PictureStatistics, Statistics
from handsight.datasets.exchange.pictures import png, tiff
from handsight.datasets.format.rows import frame_of
from handsight.datasets.format.schema import Viewpoint
from handsight.datasets.records import GraspAttempt, RgbdFrame
from handsight.servoing.planar import PlanarPose

POSE = ("x_m", "y_m", "angle_rad")
"""Names of the numbers of a state and of an action."""

_UNKNOWN = (0.0,) * len(POSE)


class RowMaker:
    """Makes rows, with something in the place of whatever an attempt lacks, and counts what is no such thing."""

    def __init__(
        self,
        features: Mapping[str, dict[str, Any]],
        *,
        size: tuple[int, int],
        viewpoints: Sequence[Viewpoint],
        flags: Sequence[str],
    ) -> None:
        self._size, self._viewpoints, self._flags = size, viewpoints, flags
        shapes = {name: feature["shape"] for name, feature in features.items()}
        images = [name for name, feature in features.items() if feature["dtype"] == "image"]
        self._pictures = {name: PictureStatistics(shapes[name][2]) for name in images}
        self._numbers = {name: NumberStatistics(shapes[name][0]) for name in shapes if name not in images}

    @property
    def statistics(self) -> Statistics:
        """Of every feature, over the rows made so far."""
        return {**self._pictures, **self._numbers}

    def row(self, attempt: GraspAttempt, episode: int, depth_scale_m: float) -> dict[str, Any]:
        """An attempt as a row of the data files."""
        frames = {viewpoint: frame_of(attempt, viewpoint) for viewpoint in self._viewpoints}
        pictures: dict[str, Any] = {}
        for viewpoint, frame in frames.items():
            pictures |= self._frame(viewpoint, frame, depth_scale_m)
        action = (attempt.pregrasp_x_m, attempt.pregrasp_y_m, attempt.pregrasp_angle_rad)
        valid: dict[str, bool] = {viewpoint: frame is not None for viewpoint, frame in frames.items()}
        valid["action"] = bool(np.isfinite(action).all())
        numbers = {
            "observation.state": _state(attempt),
            "action": action if valid["action"] else _UNKNOWN,
            **{valid_key(what): valid[what] for what in self._flags},
            "next.reward": float(attempt.success),
            "next.success": attempt.success,
            "timestamp": 0.0,
            "frame_index": 0,
            "episode_index": episode,
            "index": episode,
            "task_index": 0,
        }
        known = {"observation.state": attempt.overhead is not None, "action": valid["action"]}
        for name, value in numbers.items():
            self._numbers[name].add(value, valid=known.get(name, True))
        return pictures | numbers

    def _frame(self, viewpoint: Viewpoint, frame: RgbdFrame | None, depth_scale_m: float) -> dict[str, Any]:
        rgb = np.zeros((*self._size, 3), np.uint8) if frame is None else frame.rgb
        depth = np.zeros(self._size, np.uint16) if frame is None else frame.depth
        unit_mm = float(depth_mm_of(np.ones(1, np.uint16), depth_scale_m)[0])
        self._pictures[rgb_key(viewpoint)].add(rgb, unit=1 / 255, valid=frame is not None)
        self._pictures[depth_key(viewpoint)].add(depth, unit=unit_mm, valid=frame is not None)
        return {
            rgb_key(viewpoint): {"bytes": png(rgb), "path": None},
            depth_key(viewpoint): {"bytes": tiff(depth_mm_of(depth, depth_scale_m)), "path": None},
        }


def _state(attempt: GraspAttempt) -> tuple[float, ...]:
    if attempt.overhead is None:
        return _UNKNOWN
    pose = PlanarPose.from_pose_base_tool(attempt.overhead.pose_base_tool)
    return (pose.x_m, pose.y_m, pose.angle_rad)
