"""The pinhole camera on the gripper: intrinsics and where the grasp point lies in its frame.

Frames. The camera frame C is RDF (x right, y down, z forward along the optical axis). The tool frame T has its
origin between the fingertips, x along the direction in which the jaws close and z along the approach. Camera and tool
are mounted parallel, so one translation relates them. Pixel (0, 0) has its *centre* at coordinates (0, 0), the
convention of OpenCV and librealsense.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.servoing.errors import CameraModelError


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """A distortion-free pinhole camera. All lengths in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        faults = []
        if self.width < 1 or self.height < 1:
            faults.append(f"image size is {self.width}x{self.height}, expected at least 1x1")
        if not (self.fx > 0 and self.fy > 0 and math.isfinite(self.fx * self.fy)):
            faults.append(f"focal lengths are ({self.fx}, {self.fy}) px, expected positive and finite")
        if not (math.isfinite(self.cx) and math.isfinite(self.cy)):
            faults.append(f"principal point is ({self.cx}, {self.cy}) px, expected finite")
        if faults:
            raise CameraModelError("; ".join(faults))

    @classmethod
    def from_vertical_fov(cls, *, width: int, height: int, fov_y_rad: float) -> Intrinsics:
        """Square pixels and a centred principal point, from the vertical field of view [rad]."""
        focal = 0.5 * height / math.tan(0.5 * fov_y_rad)
        return cls(width=width, height=height, fx=focal, fy=focal, cx=(width - 1) / 2, cy=(height - 1) / 2)

    def matrix(self) -> NDArray[np.float64]:
        """K, from points in the camera frame to homogeneous pixels. Shape (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def to_json(self) -> dict[str, Any]:
        """The camera as JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Intrinsics:
        """The camera that :meth:`to_json` was called on.

        Raises:
            TypeError: A value is missing, or there is one too many.
            CameraModelError: The values make no camera.
        """
        return cls(**values)


@dataclass(frozen=True, slots=True, kw_only=True)
class HandCamera:
    """An eye-in-hand camera whose axes are parallel to the tool's."""

    intrinsics: Intrinsics
    x_tool_camera_m: float
    """Camera centre in the tool frame, along the closing direction of the jaws [m]."""
    y_tool_camera_m: float
    """Camera centre in the tool frame, across the closing direction [m]. Negative: the gripper is below the camera
    in the picture, as in section VI-C of the paper."""
    z_tool_camera_m: float
    """Camera centre in the tool frame, along the approach [m]. Negative: above the fingertips."""

    def pose_base_camera(self, pose_base_tool: NDArray[np.float64]) -> NDArray[np.float64]:
        """Camera frame in the base frame, from the tool frame in the base frame. Both have shape (4, 4)."""
        pose_tool_camera = np.eye(4)
        pose_tool_camera[:3, 3] = self.x_tool_camera_m, self.y_tool_camera_m, self.z_tool_camera_m
        pose: NDArray[np.float64] = pose_base_tool @ pose_tool_camera
        return pose

    def to_json(self) -> dict[str, Any]:
        """The camera as JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> HandCamera:
        """The camera that :meth:`to_json` was called on.

        Raises:
            KeyError, TypeError: A value is missing, or there is one too many.
            CameraModelError: The values make no camera.
        """
        return cls(**{**values, "intrinsics": Intrinsics.from_json(values["intrinsics"])})
