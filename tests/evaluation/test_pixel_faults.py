"""Shares of wrong pixels, against the same shares found another way."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.boxes import CAMERA, GRID, Box, look

from handsight.evaluation.level import inverse
from handsight.evaluation.pixel_faults import pixel_faults
from handsight.servoing.planar import PlanarPose, PlanarStep

HERE = PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.0)
BARE = look(HERE)
steps = st.builds(PlanarStep, dx_m=st.floats(-0.3, 0.3), dy_m=st.floats(-0.3, 0.3), dangle_rad=st.floats(-3, 3))


@given(step=steps)
@settings(max_examples=60, deadline=None)
def test_the_extrapolated_share_is_the_area_of_the_crop_outside_the_picture(step: PlanarStep) -> None:
    """The crop as a turned square in the raw picture, cut with the picture as polygons are."""
    k, plane_m = CAMERA.intrinsics, BARE.plane_m
    middle = (
        k.cx + (step.dx_m - CAMERA.x_tool_camera_m) * k.fx / plane_m,
        k.cy + (step.dy_m - CAMERA.y_tool_camera_m) * k.fy / plane_m,
    )
    side = float(GRID.crop_px)
    crop = cv2.boxPoints((middle, (side, side), float(np.degrees(step.dangle_rad))))
    picture = np.array([[0, 0], [k.width - 1, 0], [k.width - 1, k.height - 1], [0, k.height - 1]], np.float32)
    shared, _ = cv2.intersectConvexConvex(crop, picture)
    share = pixel_faults(BARE, BARE, step, grid=GRID).extrapolated
    assert share == pytest.approx(1 - shared / side**2, abs=0.03)  # 32 rows of pixels along each edge


@given(step=steps)
def test_the_inverse_leads_back(step: PlanarStep) -> None:
    back = HERE.after(step).after(inverse(step))
    assert (back.x_m, back.y_m, back.angle_rad) == pytest.approx((HERE.x_m, HERE.y_m, 0.0), abs=1e-9)


def test_a_wall_hides_what_is_behind_it_and_moving_past_it_shows_that() -> None:
    """A high and slender post: nearly all that is wrong around it is what it hides or no longer hides."""
    post = Box(width_m=0.02, height_m=0.2)
    step = PlanarStep(dx_m=0.06, dy_m=0.0, dangle_rad=0.0)
    found = pixel_faults(look(HERE, post), look(HERE.after(step), post), step, grid=GRID)
    assert found.occluded > 0.02
    assert found.occluded > 3 * found.displaced


def test_the_higher_an_object_the_more_it_hides() -> None:
    step = PlanarStep(dx_m=0.06, dy_m=0.0, dangle_rad=0.0)
    boxes = [Box(width_m=0.12, height_m=height_m) for height_m in (0.004, 0.04, 0.07, 0.1)]
    shares = [pixel_faults(look(HERE, box), look(HERE.after(step), box), step, grid=GRID).occluded for box in boxes]
    assert shares[0] == 0
    assert shares == sorted(set(shares))


def test_what_a_prism_hides_is_what_its_silhouette_says() -> None:
    """The strip of table that a box of height h hides beside itself, from a camera that moves along x, in numbers.

    Seen from the side, the ray over the edge meets the table h/(H-h) times the camera's distance from the edge behind
    it. What is wrong for being hidden in one picture or the other is that strip, and as much
    again for what the top of the box covers.
    """
    height_m, camera_m, width_m = 0.06, 0.5, 0.06
    box, dx_m = Box(width_m=width_m, height_m=height_m), 0.08
    step = PlanarStep(dx_m=dx_m, dy_m=0.0, dangle_rad=0.0)
    found = pixel_faults(look(HERE, box), look(HERE.after(step), box), step, grid=GRID)
    strip_m2 = height_m / (camera_m - height_m) * (dx_m - 0.5 * width_m) * width_m
    crop_m2 = (GRID.crop_px * camera_m / CAMERA.intrinsics.fx) ** 2
    assert found.occluded > strip_m2 / crop_m2
    assert found.occluded < 4 * strip_m2 / crop_m2
