"""What makes a rig pause by itself: heat, a full disk, an empty table, and figures that say that something is wrong."""

from __future__ import annotations

import shutil
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handsight.collection.ur10.rig import GuardConfig
from handsight.datasets.errors import counted
from handsight.datasets.records import GraspAttempt
from handsight.servoing.camera import HandCamera

HIGHEST_SHARE = 0.001
"""Share of the picture that must be higher than the table for something to stand on it."""


def temperature_fault(config: GuardConfig, temperatures_c: Sequence[float]) -> str:
    """Which joint is too hot; empty where none is."""
    hot = [
        f"joint {joint} has {value:.0f} degrees"
        for joint, value in enumerate(temperatures_c)
        if value > config.joint_temperature_c
    ]
    return f"{', '.join(hot)}, expected at most {config.joint_temperature_c:g}: let the arm cool" if hot else ""


def disk_fault(config: GuardConfig, folder: Path) -> str:
    """Whether the disk of a folder is nearly full; empty where it is not."""
    while not folder.exists():
        folder = folder.parent
    free_gb = shutil.disk_usage(folder).free / 1e9
    if free_gb >= config.disk_free_gb:
        return ""
    return f"{free_gb:.1f} GB are free on the disk of {folder}, expected at least {config.disk_free_gb:g}"


def height_over_table_m(
    depth: NDArray[np.uint16], depth_scale_m: float, camera: HandCamera, pose_base_tool: NDArray[np.float64]
) -> float:
    """Height of what stands highest on the table, as far as a picture from above shows it [m].

    Args:
        depth: Shape (H, W); 0 is invalid.
        depth_scale_m: Metres per unit.
        camera: Where it sits.
        pose_base_tool: From where the picture was taken, table top at z = 0. Shape (4, 4).
    """
    rotation, height_m = _view(camera, pose_base_tool)
    k = camera.intrinsics
    rows, columns = np.indices(depth.shape)
    rays = np.stack(((columns - k.cx) / k.fx, (rows - k.cy) / k.fy, np.ones(depth.shape)), axis=-1)
    z_m = height_m + depth * depth_scale_m * (rays @ rotation[2])
    return float(np.quantile(z_m[depth > 0], 1.0 - HIGHEST_SHARE)) if (depth > 0).any() else 0.0


def _view(camera: HandCamera, pose_base_tool: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    pose = camera.pose_base_camera(pose_base_tool)
    return pose[:3, :3], float(pose[2, 3])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Seen:
    """An attempt without its pictures."""

    labelled: bool
    success: bool


class SuccessWindow:
    """The last attempts, watched for a rate of success that no table of objects explains."""

    def __init__(self, config: GuardConfig) -> None:
        """Nothing was seen yet."""
        self._config = config
        self._recent: deque[_Seen] = deque(maxlen=max(config.success_window, 1))

    def add(self, attempt: GraspAttempt) -> str:
        """Count an attempt; returns what is wrong, or an empty text."""
        config = self._config
        if not config.success_window:
            return ""
        self._recent.append(_Seen(labelled=attempt.labelled, success=attempt.success))
        if len(self._recent) < config.success_window:
            return ""
        labelled = [seen for seen in self._recent if seen.labelled]
        aborted = 1.0 - len(labelled) / len(self._recent)
        if aborted > config.most_aborted:
            return f"{aborted:.0%} of the last {counted(len(self._recent), 'attempt')} carry no label: look at the log"
        rate = sum(seen.success for seen in labelled) / max(len(labelled), 1)
        if rate < config.least_success:
            return (
                f"{rate:.1%} of the last {counted(len(labelled), 'grasp')} succeeded, expected at least "
                f"{config.least_success:.1%}: look at objects, gripper and camera"
            )
        return ""
