"""The D435's errors, where the model says they are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from handsight.collection.depth_noise import BASELINE_M, DISPARITY_STEP_PX, FOV_X_RAD, DepthNoise

FOCAL_PX = 320 / math.tan(0.5 * FOV_X_RAD)
NEARLY_EXACT = DepthNoise(subpixel_px=1e-9, seed=1)


def plane(depth_m: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.full((480, 640), depth_m)


@pytest.mark.parametrize("depth_m", [0.3, 0.6, 1.2])
def test_the_error_grows_with_the_square_of_the_distance(depth_m: float) -> None:
    measured_m = DepthNoise(subpixel_px=0.1, seed=4).measured(plane(depth_m), look=0)
    expected_m = depth_m**2 * 0.1 / (FOCAL_PX * BASELINE_M)
    assert measured_m.std() == pytest.approx(expected_m, rel=0.1)
    assert measured_m.mean() == pytest.approx(depth_m, abs=expected_m)


def test_disparity_comes_in_steps() -> None:
    measured_m = NEARLY_EXACT.measured(np.linspace(0.4, 0.9, 640)[None, :].repeat(480, axis=0), look=0)
    steps = FOCAL_PX * BASELINE_M / measured_m[measured_m > 0] / DISPARITY_STEP_PX
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)


def test_near_things_shadow_what_lies_left_of_them() -> None:
    """The second imager stands to the right: it cannot see a strip on the left, as wide as the disparities differ."""
    scene_m = plane(0.6)
    scene_m[100:300, 300:400] = 0.4
    answered = NEARLY_EXACT.measured(scene_m, look=0) > 0
    strip_px = FOCAL_PX * BASELINE_M * (1 / 0.4 - 1 / 0.6)
    left = ~answered[150:250, 300 - round(strip_px) + 2 : 299]
    assert left.all()
    assert answered[150:250, : 300 - round(strip_px) - 3].all()
    assert answered[150:250, 403:].all()


def test_some_of_the_edge_is_lost_and_all_that_is_too_near() -> None:
    scene_m = plane(0.6)
    scene_m[100:300, 300:400] = 0.4
    lower_edge = NEARLY_EXACT.measured(scene_m, look=0)[299:301, 305:395] == 0
    assert 0.2 < lower_edge.mean() < 0.8
    assert not NEARLY_EXACT.measured(plane(0.1), look=0).any()


def test_every_look_and_every_seed_errs_differently_and_repeatably() -> None:
    noise = DepthNoise(subpixel_px=0.1, seed=7)
    pictures = [noise.measured(plane(0.6), look) for look in (0, 1, 0)]
    assert np.array_equal(pictures[0], pictures[2])
    assert not np.array_equal(pictures[0], pictures[1])
    other = DepthNoise(subpixel_px=0.1, seed=8).measured(plane(0.6), look=0)
    assert not np.array_equal(pictures[0], other)
