"""Heat reads on objects of any colour, and angles look alike after half a turn."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from handsight.servoing.heatmap import Heatmap
from handsight.viz import palette
from handsight.viz.heat_look import angle_rgb, axial_deg, contours, muted, shaded_depth, strokes, with_heat

OBJECTS = {
    "yellow": (245, 210, 40),
    "orange": (240, 130, 30),
    "red": (200, 40, 40),
    "white": (240, 240, 240),
    "black": (20, 20, 20),
    "blue": (40, 80, 190),
    "wood": (195, 155, 110),
}


def lab(rgb: tuple[int, ...]) -> NDArray[np.float32]:
    pixel = np.array([[rgb]], np.float32) / 255
    return np.asarray(cv2.cvtColor(pixel, cv2.COLOR_RGB2LAB)[0, 0], dtype=np.float32)


@pytest.mark.parametrize("name", OBJECTS)
def test_hot_is_told_from_cold_on_an_object_of_any_colour(name: str) -> None:
    """By a CIELAB difference of 25 at least, where over the picture itself a yellow object hides most of it."""
    rgb = np.array([[OBJECTS[name]]], np.uint8)
    cold, hot = (with_heat(muted(rgb), np.array([[score]], np.float32))[0, 0] for score in (0.0, 0.9))
    assert np.linalg.norm(lab(tuple(hot)) - lab(tuple(cold))) > 25


def test_under_heat_colours_of_objects_do_not_pass_for_scores() -> None:
    scale = np.stack([lab(tuple(one)) for one in palette.score_rgb(np.linspace(0.5, 1, 50)).tolist()])
    for colour in OBJECTS.values():
        shown = muted(np.array([[colour]], np.uint8))[0, 0]
        assert np.linalg.norm(scale - lab(tuple(shown)), axis=1).min() > 30


@pytest.mark.parametrize("angle_rad", [0.0, 0.3, -1.2, 1.5])
def test_half_a_turn_is_none_for_equal_jaws(angle_rad: float) -> None:
    both = angle_rgb(np.array([angle_rad, angle_rad + math.pi]))
    assert np.abs(both[0].astype(int) - both[1]).max() <= 1
    assert axial_deg(angle_rad) == axial_deg(angle_rad + math.pi) == axial_deg(angle_rad - math.pi)
    assert 0 <= axial_deg(angle_rad) < 180


def test_angles_are_told_apart_and_equally_light() -> None:
    colours = [lab(tuple(one)) for one in angle_rgb(np.radians(np.arange(0, 180, 30))).tolist()]
    for at, one in enumerate(colours):
        for other in colours[at + 1 :]:
            assert np.linalg.norm(one - other) > 30
    lightness = [one[0] for one in colours]
    assert max(lightness) - min(lightness) < 8


def cone() -> Heatmap:
    axis = np.arange(20, dtype=np.float32)
    distance = np.hypot(axis[None] - 9, axis[:, None] - 11)
    return Heatmap(
        scores=np.clip(1 - distance / 8, 0, 1).astype(np.float32),
        columns_px=10 + 4 * axis,
        rows_px=20 + 3 * axis,
        angle_rad=0.0,
    )


def test_a_contour_goes_around_what_reaches_the_level() -> None:
    (line,) = contours(cone(), 0.5)
    across = np.hypot((line[:, 0] - 46) / 4, (line[:, 1] - 53) / 3)
    np.testing.assert_allclose(across, 4, atol=0.2)
    np.testing.assert_array_equal(line[0], line[-1])
    assert contours(cone(), 1.01) == []


def test_strokes_lie_along_the_jaws_where_scores_are_high() -> None:
    heatmap = cone()
    angles_rad = np.full(heatmap.scores.shape, math.radians(30))
    lines = strokes(heatmap, angles_rad, least=0.6, every=2, length_px=10)
    assert lines
    for line in lines:
        along = line[1] - line[0]
        assert math.degrees(math.atan2(along[1], along[0])) == pytest.approx(30)
        assert np.hypot(*along) == pytest.approx(10)
        column, row = (line.mean(axis=0) - (10, 20)) / (4, 3)
        assert heatmap.scores[round(row), round(column)] >= 0.6


def test_depth_under_heat_is_lighter_the_nearer_and_black_where_there_is_none() -> None:
    grey = shaded_depth(np.array([[0.40, 0.45, 0.5, 0.0, np.nan]], np.float32), near_m=0.4, far_m=0.5)
    near, middle, far, none, nan = grey[0, :, 0].tolist()
    assert near > middle > far > none == nan == 0
