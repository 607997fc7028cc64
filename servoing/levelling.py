"""A view as a camera would have it that looks straight down, by the table that it sees.

The homography (section III-A) moves a camera whose picture is parallel to the table. A mount that was knocked breaks
that: 5 degrees move the table by 44 mm under a camera 0.5 m above it, in every picture, so that a loop servoes to the
wrong place with care. But the table's own depth tells the tilt. What it cannot tell is a turn about the vertical.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from handsight.servoing.camera_turn import CameraTurn
from handsight.servoing.view import View

LEAST_TILT_RAD: Final = math.radians(0.2)
"""Below it a view stays as it is: 2 mm under a camera half a metre high, and less than resampling costs."""
MOST_TILT_RAD: Final = math.radians(15.0)
"""What tilts further is no table."""
LEAST_SHARE: Final = 0.3
"""Of the pixels with depth, that have to lie on one plane for it to be the table."""
_EVERY = 8
"""Pixels from one that is looked at to the next."""
_LEAST_PIXELS = 50
_BANDS_M = (0.060, 0.030, 0.015, 0.010, 0.008, 0.006, 0.006, 0.006, 0.005, 0.004, 0.004)
"""How much nearer than the plane found so far a pixel may be, to count for the next [m]: objects go, noise stays."""
_BOTH_WAYS_M = 0.005
"""From this band on it may be no farther either. Before, objects have drawn the plane up from a table below it."""


def levelled(view: View) -> View:
    """The view, turned about the camera's centre until the table is parallel to the picture.

    What comes from outside has the colour of the edge and no depth. A view in which no table is found, or that is
    level already, is returned as it is.
    """
    normal = table_normal(view)
    if normal is None:
        return view
    tilt_rad = math.acos(min(1.0, float(normal[2])))
    if not LEAST_TILT_RAD < tilt_rad < MOST_TILT_RAD:
        return view
    return _turned(view, _upright(normal))


def table_normal(view: View) -> NDArray[np.float64] | None:
    """The direction in which the table lies, in the camera frame; (0, 0, 1) for a camera that looks straight down.

    On a plane n.X = d the inverse depth 1/z = n.(x, y, 1)/d is linear in the normalised pixel (x, y), so that a plane
    is a linear least-squares fit; pixels off it are left out, more strictly from fit to fit.

    Returns:
        A unit vector, shape (3,); None where too few pixels lie on one plane.
    """
    k = view.camera.intrinsics
    rows, columns = np.nonzero(view.valid[::_EVERY, ::_EVERY])
    depth_m = view.depth_m[::_EVERY, ::_EVERY][rows, columns].astype(np.float64)  # (N,)
    pixels = np.stack(
        [(columns * _EVERY - k.cx) / k.fx, (rows * _EVERY - k.cy) / k.fy, np.ones(len(rows))], axis=-1
    )  # (N, 3)
    least = max(_LEAST_PIXELS, LEAST_SHARE * len(rows))
    on_plane = np.ones(len(rows), dtype=np.bool_)
    plane: NDArray[np.float64] = np.zeros(3)
    for band_m in _BANDS_M:
        if np.count_nonzero(on_plane) < least:
            return None
        plane = np.asarray(np.linalg.lstsq(pixels[on_plane], 1 / depth_m[on_plane], rcond=None)[0], dtype=np.float64)
        inverse = pixels @ plane
        # Rays that meet the plane behind the camera meet it nowhere: infinitely far ahead.
        plane_m = np.divide(1.0, inverse, out=np.full_like(inverse, np.inf), where=inverse > 0)
        on_plane = plane_m - depth_m < band_m
        if band_m <= _BOTH_WAYS_M:
            on_plane &= depth_m - plane_m < band_m
    if np.count_nonzero(on_plane) < least:
        return None
    normal: NDArray[np.float64] = plane / np.linalg.norm(plane)
    return normal


def _upright(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """The smallest rotation that takes a direction to (0, 0, 1), by Rodrigues' formula. (3,) -> (3, 3)."""
    x, y, cos = normal.tolist()
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])  # [n x e_z] as a matrix
    rotation: NDArray[np.float64] = np.eye(3) + cross + cross @ cross / (1 + cos)
    return rotation


def _turned(view: View, rotation_turned_camera: NDArray[np.float64]) -> View:
    """The view of the camera turned about its centre; the rotation takes directions to its axes. Shape (3, 3)."""
    turn = CameraTurn(view.camera.intrinsics, rotation_turned_camera)
    return replace(view, rgb=turn.colours(view.rgb), depth_m=turn.depths(view.measured_m))
