"""What a camera that is turned about its centre sees of a frame that was taken straight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handsight.datasets.records import RgbdFrame
from handsight.servoing.camera import Intrinsics
from handsight.servoing.camera_turn import CameraTurn


def random_turn(angle_rad: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """A turn by an angle about an axis that is uniform over all directions. Shape (3, 3)."""
    axis = rng.normal(size=3)
    rotation: NDArray[np.float64] = Rotation.from_rotvec(angle_rad * axis / np.linalg.norm(axis)).as_matrix()
    return rotation


def turned_frame(frame: RgbdFrame, intrinsics: Intrinsics, turned_from_camera: NDArray[np.float64]) -> RgbdFrame:
    """A frame as the turned camera would have taken it from the same place.

    What lies outside the frame is unknown: such pixels take the colour of its edge, and have no depth.

    Args:
        frame: As it was taken.
        intrinsics: Of the camera, which both share.
        turned_from_camera: Rotation that takes directions from the camera's axes (x right, y down, z forward) to the
            axes of the turned camera. Shape (3, 3).
    """
    turn = CameraTurn(intrinsics, turned_from_camera)
    return replace(frame, rgb=turn.colours(frame.rgb), depth=turn.depths(frame.depth))
