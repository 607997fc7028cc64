"""Views predicted by the point cloud, on drawn tables."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.support.boxes import Box, look
from tests.support.scorers import FunctionScorer

from handsight.evaluation.point_cloud import predicted_by_points
from handsight.evaluation.prediction_error import prediction_error
from handsight.servoing.homography import InputGrid
from handsight.servoing.planar import PlanarPose, PlanarStep
from handsight.servoing.view import View

START = PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.3)
MEAN_RED = FunctionScorer(lambda inputs: inputs[:, 0].mean((1, 2)), InputGrid(crop_px=160, size_px=32))
steps = st.builds(PlanarStep, dx_m=st.floats(-0.1, 0.1), dy_m=st.floats(-0.1, 0.1), dangle_rad=st.floats(-1.5, 1.5))


def test_no_step_leaves_the_picture_as_it_is() -> None:
    view = look(START, Box(height_m=0.08))
    same = predicted_by_points(view, PlanarStep(dx_m=0.0, dy_m=0.0, dangle_rad=0.0))
    np.testing.assert_array_equal(same.rgb, view.rgb)
    np.testing.assert_array_equal(same.depth_m, view.depth_m)


@given(step=steps)
@settings(max_examples=20, deadline=None)
def test_objects_stand_where_they_are_seen_after_the_step(step: PlanarStep) -> None:
    box = Box(height_m=0.08)
    before, after = look(START, box), look(START.after(step), box)
    predicted = predicted_by_points(before, step)
    top_m = float(after.depth_m.min())
    tops = [np.abs(view.depth_m - top_m) < 1e-3 for view in (before, after, predicted)]
    assume(tops[0].any() and tops[1].sum() >= 1500)  # The box is in both pictures.
    seen = tops[1] & tops[2]
    assert seen.sum() / (tops[1] | tops[2]).sum() > 0.75


@pytest.mark.parametrize("dx_m", [0.02, 0.05])
def test_a_tall_object_is_predicted_better_than_by_a_plane(dx_m: float) -> None:
    step, box = PlanarStep(dx_m=dx_m, dy_m=0.0, dangle_rad=0.2), Box(height_m=0.1)
    error = prediction_error(look(START, box), look(START.after(step), box), step, MEAN_RED)
    assert error.points_height_rms_m < 0.6 * error.height_rms_m
    assert error.points_score_error == pytest.approx(error.points_score - error.true_score)


def test_holes_take_what_is_beside_them_and_a_picture_of_nothing_is_the_first_point() -> None:
    view = look(START)
    depth_m = view.depth_m.copy()
    depth_m[100:110, 100:110] = 0
    holed = View(rgb=view.rgb, depth_m=depth_m, camera=view.camera)
    filled = predicted_by_points(holed, PlanarStep(dx_m=0.0, dy_m=0.0, dangle_rad=0.0))
    assert filled.valid.all()
    np.testing.assert_allclose(filled.depth_m, view.depth_m, atol=1e-6)
    far = predicted_by_points(holed, PlanarStep(dx_m=5.0, dy_m=0.0, dangle_rad=0.0))
    assert (far.rgb == view.rgb[0, 0]).all()
