"""Laws of the error of a predicted input, on drawn tables."""

from __future__ import annotations

import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.support.boxes import CAMERA_HEIGHT_M, GRID, Box, look
from tests.support.scorers import FunctionScorer

from handsight.evaluation.prediction_error import PredictionError, height_at_grasp_m, prediction_error
from handsight.servoing.planar import PlanarPose, PlanarStep

MEAN_RED = FunctionScorer(lambda inputs: inputs[:, 0].mean((1, 2)), GRID)
START = PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.3)
steps = st.builds(PlanarStep, dx_m=st.floats(-0.15, 0.15), dy_m=st.floats(-0.15, 0.15), dangle_rad=st.floats(-1.5, 1.5))


def error(step: PlanarStep, *boxes: Box, start: PlanarPose = START) -> PredictionError:
    return prediction_error(look(start, *boxes), look(start.after(step), *boxes), step, MEAN_RED)


@given(x_m=st.floats(0.55, 0.65), height_m=st.floats(0.01, 0.12))
@settings(max_examples=10, deadline=None)
def test_no_step_has_no_error(x_m: float, height_m: float) -> None:
    here = error(PlanarStep(dx_m=0.0, dy_m=0.0, dangle_rad=0.0), Box(x_m=x_m, height_m=height_m))
    assert (here.colour_rms, here.height_rms_m, here.score_error) == (0.0, 0.0, 0.0)
    assert (here.faults.occluded, here.faults.displaced) == (0.0, 0.0)


@given(step=steps)
@settings(max_examples=60, deadline=None)
def test_a_bare_table_is_predicted_to_the_resampling_wherever_the_picture_reaches(step: PlanarStep) -> None:
    there = error(step)
    assert (there.faults.occluded, there.faults.displaced) == (0.0, 0.0)
    assert there.height_rms_m < 1e-6
    assume(there.faults.extrapolated == 0)
    assert there.colour_rms < 0.005
    assert abs(there.score_error) < 0.002


def test_what_lies_beyond_the_picture_is_wrong_on_a_bare_table_too() -> None:
    there = error(PlanarStep(dx_m=0.2, dy_m=0.0, dangle_rad=0.0))
    assert there.faults.extrapolated > 0.2
    assert there.colour_rms > 0.02


@pytest.mark.parametrize(
    "step",
    [PlanarStep(dx_m=0.04, dy_m=0.0, dangle_rad=0.0), PlanarStep(dx_m=0.0, dy_m=-0.03, dangle_rad=0.8)],
    ids=["moved", "turned"],
)
def test_the_higher_an_object_the_larger_the_error_of_a_step(step: PlanarStep) -> None:
    errors = [error(step, Box(height_m=height_m)) for height_m in (0.01, 0.03, 0.06, 0.1)]
    for measure in ("colour_rms", "height_rms_m"):
        values = [getattr(one, measure) for one in errors]
        assert values == sorted(set(values)), measure


def test_the_farther_a_step_the_larger_its_error() -> None:
    errors = [error(PlanarStep(dx_m=dx_m, dy_m=0.0, dangle_rad=0.0), Box()) for dx_m in (0.005, 0.02, 0.05, 0.08)]
    assert [one.height_rms_m for one in errors] == sorted({one.height_rms_m for one in errors})


def test_scores_are_those_of_the_network() -> None:
    step = PlanarStep(dx_m=0.05, dy_m=0.02, dangle_rad=0.4)
    seen = FunctionScorer(lambda inputs: torch.sigmoid(40 * inputs[:, 3].amin((1, 2))), GRID)
    start = START.after(PlanarStep(dx_m=-0.05, dy_m=0.0, dangle_rad=0.0))
    there = prediction_error(look(start, Box()), look(start.after(step), Box()), step, seen)
    assert there.score_error == there.predicted_score - there.true_score != 0


def test_the_height_at_the_grasp_is_that_of_the_object_between_the_fingertips() -> None:
    over, beside = look(START, Box(height_m=0.07)), look(PlanarPose(x_m=0.7, y_m=0.0, angle_rad=1.0), Box())
    assert height_at_grasp_m(over, camera_height_m=CAMERA_HEIGHT_M, radius_m=0.02) == pytest.approx(0.07, abs=1e-4)
    assert height_at_grasp_m(beside, camera_height_m=CAMERA_HEIGHT_M, radius_m=0.02) == pytest.approx(0, abs=1e-4)
