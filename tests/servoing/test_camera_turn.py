"""Turning there and back leaves a picture, whatever its depth is stored as; what was never seen has none.

That it is what a camera sees that was turned is tested where a camera is: ``tests/evaluation/test_turned_camera.py``.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handsight.servoing.camera import Intrinsics
from handsight.servoing.camera_turn import CameraTurn

K = Intrinsics(width=160, height=120, fx=150.0, fy=140.0, cx=80.5, cy=58.0)
TURNS = st.builds(
    lambda axis, degrees: Rotation.from_rotvec(math.radians(degrees) * np.array(axis) / math.hypot(*axis)).as_matrix(),
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: math.hypot(*axis) > 0.1),
    st.floats(0, 10),
)


def smooth() -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Colours and depths in which neighbours are alike, as resampling mixes or mistakes them."""
    columns, rows = np.meshgrid(np.arange(K.width), np.arange(K.height))
    waves = np.stack([np.sin(columns / 20), np.cos(rows / 25), np.sin((columns + rows) / 30)], axis=-1)
    return (128 + 100 * waves).astype(np.uint8), (0.5 + 0.1 * waves[..., 2]).astype(np.float32)


@settings(max_examples=40)
@given(rotation=TURNS)
def test_there_and_back_is_where_it_was(rotation: NDArray[np.float64]) -> None:
    rgb, depth_m = smooth()
    there, back = CameraTurn(K, rotation), CameraTurn(K, rotation.T)
    depth_after = back.depths(there.depths(depth_m))
    kept = depth_after > 0
    assert kept.mean() > 0.5
    assert np.abs(depth_after - depth_m)[kept].max() < 0.02
    unlike = np.abs(back.colours(there.colours(rgb)).astype(int) - rgb)[kept]
    assert unlike.max() <= 25
    assert unlike.mean() < 2


@settings(max_examples=20)
@given(rotation=TURNS)
def test_millimetres_are_metres_rounded(rotation: NDArray[np.float64]) -> None:
    turn, depth_mm = CameraTurn(K, rotation), np.rint(smooth()[1] * 1000).astype(np.uint16)
    in_mm, in_m = turn.depths(depth_mm), turn.depths((depth_mm / 1000).astype(np.float32))
    assert in_mm.dtype == np.uint16
    assert in_m.dtype == np.float32
    np.testing.assert_array_equal(in_mm == 0, in_m == 0)
    np.testing.assert_allclose(in_mm, in_m * 1000, atol=0.51)


@pytest.mark.parametrize("degrees", [20, -20])
def test_what_was_outside_has_no_depth_and_the_colour_of_the_edge(degrees: float) -> None:
    turn = CameraTurn(K, Rotation.from_euler("y", degrees, degrees=True).as_matrix())
    rgb = np.full((K.height, K.width, 3), 77, np.uint8)
    depth = turn.depths(np.full((K.height, K.width), 500, np.uint16))
    new, old = (depth[:, :30], depth[:, -60:]) if degrees > 0 else (depth[:, -30:], depth[:, :60])
    assert not new.any()
    assert old[40:80].all()
    assert (turn.colours(rgb) == 77).all()
