"""What a knocked camera sees is turned back by the table in it, whatever lies there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.levelling import LEAST_TILT_RAD, MOST_TILT_RAD, levelled, table_normal
from handsight.servoing.view import View

K = Intrinsics(width=160, height=120, fx=150.0, fy=140.0, cx=80.5, cy=58.0)
CAMERA = HandCamera(intrinsics=K, x_tool_camera_m=0.0, y_tool_camera_m=-0.07, z_tool_camera_m=-0.1)
TABLE_M = 0.5
STRAIGHT = np.array([0.0, 0.0, 1.0])
TILTS = st.tuples(st.floats(0.3, 12), st.floats(-math.pi, math.pi))
"""By how many degrees, about which horizontal axis."""


def tilted(degrees: float, about_rad: float) -> NDArray[np.float64]:
    """Rotation from the axes of a camera that looks straight down to those of one that is tilted. Shape (3, 3)."""
    axis = np.array([math.cos(about_rad), math.sin(about_rad), 0.0])
    rotation: NDArray[np.float64] = Rotation.from_rotvec(math.radians(degrees) * axis).as_matrix()
    return rotation


def seen(rotation: NDArray[np.float64], *, box_m: float = 0.0, noise_m: float = 0.0, covered: float = 0.3) -> View:
    """Table and box as a turned camera sees them, by casting the ray of every pixel; colours tell where each hits.

    The box covers the middle of the level picture, so wide that it has that share of it.
    """
    columns, rows = np.meshgrid(np.arange(K.width), np.arange(K.height))
    rays = np.stack([(columns - K.cx) / K.fx, (rows - K.cy) / K.fy, np.ones_like(columns, dtype=float)], axis=-1)
    down = rays @ rotation  # R^T r: in the axes of the camera that looks straight down. (H, W, 3)
    place = down[..., :2] / down[..., 2:] * (TABLE_M - box_m)
    half_m = 0.5 * math.sqrt(covered) * (TABLE_M - box_m) * np.array([K.width / K.fx, K.height / K.fy])
    on_box: NDArray[np.bool_] = np.all(np.abs(place) < half_m, axis=-1) & (box_m > 0)
    depth_m = np.where(on_box, TABLE_M - box_m, TABLE_M) / down[..., 2]
    if noise_m:
        depth_m = depth_m + np.random.default_rng(0).normal(scale=noise_m, size=depth_m.shape)
    rgb = np.where(on_box[..., None], (250, 20, 20), (20, 20, 250)).astype(np.uint8)
    return View(rgb=rgb, depth_m=depth_m.astype(np.float32), camera=CAMERA)


@settings(max_examples=60, deadline=None)
@given(tilt=TILTS, box_m=st.sampled_from([0.0, 0.03, 0.12]), noise_m=st.sampled_from([0.0, 0.002]))
def test_the_table_is_level_again(tilt: tuple[float, float], box_m: float, noise_m: float) -> None:
    rotation = tilted(*tilt)
    view = seen(rotation, box_m=box_m, noise_m=noise_m)
    normal = table_normal(view)
    assert normal is not None
    assert math.degrees(math.acos(min(1.0, float(normal @ rotation @ STRAIGHT)))) < (0.3 if noise_m else 0.01)
    after = levelled(view)
    table = after.valid & (after.rgb[..., 2] > 200)
    assert np.median(after.depth_m[table]) == pytest.approx(TABLE_M, abs=2e-3)
    spread_m = np.percentile(after.depth_m[table], 95) - np.percentile(after.depth_m[table], 5)
    assert spread_m < 4e-3 + 4 * noise_m


@settings(max_examples=30, deadline=None)
@given(tilt=TILTS)
def test_things_are_where_a_level_camera_sees_them(tilt: tuple[float, float]) -> None:
    """To a pixel or two: what is outside of either picture is left out."""
    assume(tilt[0] < 8)
    level, after = seen(np.eye(3), box_m=0.05, covered=0.1), levelled(seen(tilted(*tilt), box_m=0.05, covered=0.1))
    box, same = level.rgb[..., 0] > 128, after.rgb[..., 0] > 128
    for before, now in zip(np.nonzero(box), np.nonzero(same), strict=True):
        assert abs(before.mean() - now.mean()) < 1.5
    assert np.count_nonzero(box ^ same) < 0.15 * np.count_nonzero(box)
    assert np.median(after.depth_m[same & after.valid]) == pytest.approx(TABLE_M - 0.05, abs=2e-3)


@pytest.mark.parametrize("degrees", [0.0, 0.5 * math.degrees(LEAST_TILT_RAD)])
def test_a_level_view_is_the_very_same(degrees: float) -> None:
    view = seen(tilted(degrees, 1.0), box_m=0.05)
    assert levelled(view) is view


def test_a_view_without_a_table_is_the_very_same() -> None:
    view = seen(np.eye(3))
    rng = np.random.default_rng(0)
    rugged = replace(view, depth_m=rng.uniform(0.2, 0.8, view.depth_m.shape).astype(np.float32))
    empty = replace(view, depth_m=np.full_like(view.depth_m, np.nan))
    steep = seen(tilted(math.degrees(MOST_TILT_RAD) + 3, 0.5))
    for one in (rugged, empty, steep):
        assert levelled(one) is one
    assert table_normal(empty) is None


def test_what_has_no_depth_has_none_afterwards() -> None:
    view = seen(tilted(4, 0.3))
    depth_m = view.depth_m.copy()
    depth_m[40:80, 60:100] = np.nan
    after = levelled(replace(view, depth_m=depth_m))
    assert np.isfinite(after.depth_m).all()
    assert not after.valid[58, 80]
    assert after.valid[100, 20]
    assert after.camera is view.camera
