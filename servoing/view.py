"""What the hand camera sees at one pose: an aligned RGB-D frame in metres, and the camera that took it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.servoing.camera import HandCamera
from handsight.servoing.errors import ImageError


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """One aligned RGB-D picture and the camera that took it."""

    rgb: NDArray[np.uint8]
    """Shape (H, W, 3)."""
    depth_m: NDArray[np.float32]
    """Distance along the optical axis [m]; 0 or NaN is invalid. Shape (H, W)."""
    camera: HandCamera

    def __post_init__(self) -> None:
        k = self.camera.intrinsics
        faults = []
        if self.rgb.shape != (k.height, k.width, 3) or self.rgb.dtype != np.uint8:
            faults.append(f"rgb is {self.rgb.dtype} {self.rgb.shape}, expected uint8 {(k.height, k.width, 3)}")
        if self.depth_m.shape != (k.height, k.width):
            faults.append(f"depth has shape {self.depth_m.shape}, expected {(k.height, k.width)}")
        if self.depth_m.dtype.kind != "f":
            faults.append(f"depth is {self.depth_m.dtype}, expected floating-point metres")
        if faults:
            raise ImageError("; ".join(faults))

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where depth was measured. Shape (H, W)."""
        return np.isfinite(self.depth_m) & (self.depth_m > 0)

    @property
    def measured_m(self) -> NDArray[np.float32]:
        """Depth where it was measured, 0 elsewhere [m]. Shape (H, W)."""
        depth_m = np.ascontiguousarray(self.depth_m, np.float32)
        return np.asarray(cv2.copyTo(depth_m, self.valid.view(np.uint8)), np.float32)

    @property
    def plane_m(self) -> float:
        """Distance of the plane on which everything is assumed to lie: the mean valid depth (section III-A) [m].

        Raises:
            ImageError: No pixel has a valid depth.
        """
        return mean_depth_m(self.measured_m)


def mean_depth_m(measured_m: NDArray[np.float32]) -> float:
    """Mean of the depths that are not 0 [m].

    Args:
        measured_m: Depth, 0 where it was not measured [m]. Shape (H, W).

    Raises:
        ImageError: All are 0.
    """
    count = cv2.countNonZero(measured_m)
    if count == 0:
        raise ImageError("no pixel of the depth picture is valid, expected at least one; check the camera")
    return cv2.sumElems(measured_m)[0] / count  # Added up in float64.
