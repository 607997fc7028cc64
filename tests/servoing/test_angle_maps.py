"""Maps of all angles against crop by crop."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from tests.support.drawn_table import BRIGHTNESS, CAMERA, DISTANCE_M, GRID, START, DrawnTable
from tests.support.networks import trained_looking
from tests.support.scorers import FunctionScorer

from handsight.servoing.angle_maps import angle_maps, angles_over_half_a_circle
from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.homography import predict_inputs
from handsight.servoing.objective import Objective
from handsight.servoing.prepared_view import PreparedView
from handsight.servoing.scorer import GraspScorer
from handsight.servoing.view import View
from handsight.training.gqn import GqnConfig
from handsight.training.scorer import Scorer

CONFIG = GqnConfig(widths=(8, 8), kernels=(5, 3), dense=(16,), size_px=GRID.size_px)


@pytest.fixture(scope="module")
def scorer() -> Scorer:
    return Scorer(trained_looking(CONFIG), GRID)


@pytest.fixture(scope="module")
def view() -> View:
    """A table with edges on it, at which scores change fast."""
    plain, _ = DrawnTable(START).look()
    rgb, depth_m = plain.rgb.copy(), plain.depth_m.copy()
    rgb[30:70, 90:110], depth_m[30:70, 90:110] = (200, 30, 90), DISTANCE_M - 0.06
    return View(rgb=rgb, depth_m=depth_m, camera=CAMERA)


def crop_by_crop(
    view: View, scorer: GraspScorer, maps_shape: tuple[int, ...], every: int, angle_rad: float
) -> np.ndarray:
    objective = Objective(view, scorer)
    steps = objective.sweep(0.0, every=every).steps.reshape(-1, 3).clone()
    steps[:, 2] = angle_rad
    return objective(steps).numpy().reshape(maps_shape)


@pytest.mark.parametrize("every", [1, 2, 4])
def test_dense_maps_are_those_of_each_crop_but_for_reading_between_points(
    view: View, scorer: Scorer, every: int
) -> None:
    maps = angle_maps(view, scorer, angles=6, spacing_px=3 * every)
    assert maps.dense
    for index, angle_rad in enumerate(maps.angles_rad.tolist()):
        exact = crop_by_crop(view, scorer, maps.scores[index].shape, every, angle_rad)
        off = np.abs(maps.scores[index] - exact)
        if angle_rad == 0:
            assert off.max() < 1e-4
        else:
            assert off.mean() < 0.02 * np.ptp(exact)
            assert np.corrcoef(exact.ravel(), maps.scores[index].ravel())[0, 1] > 0.98


def test_without_a_dense_form_every_point_is_scored_by_itself(view: View, scorer: Scorer) -> None:
    plain = FunctionScorer(scorer, GRID)
    padded = Scorer(trained_looking(GqnConfig(**{**CONFIG.to_json(), "padded": True, "kernels": (5, 3)})), GRID)
    for one in (plain, padded):
        maps = angle_maps(view, one, angles=3, spacing_px=12)
        assert not maps.dense
        for index, angle_rad in enumerate(maps.angles_rad.tolist()):
            exact = crop_by_crop(view, one, maps.scores[index].shape, 4, angle_rad)
            np.testing.assert_allclose(maps.scores[index], exact, atol=1e-4)


def test_a_picture_from_above_is_scored_as_from_where_grasps_begin(view: View, scorer: Scorer) -> None:
    """A point of the map is the score of the input that the homography makes for that step and that height."""
    plane_m = 0.8 * view.plane_m
    maps = angle_maps(view, scorer, angles=2, spacing_px=5, view_plane_m=plane_m)
    straight = maps.at(maps.straight).scores
    row, column = np.unravel_index(np.abs(straight - 0.5).argmin(), straight.shape)  # where scores tell most
    dx_m = (maps.columns_px[column] - CAMERA.intrinsics.cx) * view.plane_m / CAMERA.intrinsics.fx
    dy_m = (maps.rows_px[row] - CAMERA.intrinsics.cy) * view.plane_m / CAMERA.intrinsics.fy
    step = torch.tensor([[dx_m + CAMERA.x_tool_camera_m, dy_m + CAMERA.y_tool_camera_m, 0.0]], dtype=torch.float32)
    prepared = PreparedView.from_view(view, pixels_per_cell=GRID.pixels_per_cell)
    from_there = scorer(predict_inputs(prepared, step, grid=GRID, view_plane_m=plane_m))
    from_above = scorer(predict_inputs(prepared, step, grid=GRID))
    assert straight[row, column] == pytest.approx(float(from_there[0]), abs=1e-4)
    assert abs(float(from_there[0]) - float(from_above[0])) > 1e-3


def test_the_best_of_all_angles_and_where_it_is(view: View, scorer: Scorer) -> None:
    maps = angle_maps(view, scorer, angles=5, spacing_px=9)
    assert (maps.best == maps.scores.max(axis=0)).all()
    picked = np.take_along_axis(maps.scores, maps.scores.argmax(axis=0)[None], axis=0)[0]
    assert (picked == maps.best).all()
    assert set(np.unique(maps.best_angle_rad)) <= set(maps.angles_rad.tolist())
    assert maps.best_map.scores.max() == maps.scores.max()


@pytest.mark.parametrize("count", [1, 2, 3, 18, 180])
def test_angles_cover_half_a_circle_with_none_among_them_twice(count: int) -> None:
    angles_rad = angles_over_half_a_circle(count)
    assert 0.0 in angles_rad
    assert np.allclose(np.diff(angles_rad), math.pi / count)
    assert np.ptp(angles_rad) < math.pi


@pytest.mark.parametrize("count", [0, -1, 181])
def test_numbers_of_angles_that_are_none_are_refused(count: int) -> None:
    view, _ = DrawnTable(START).look()
    with pytest.raises(ServoSettingsError, match="expected 1 to 180"):
        angle_maps(view, BRIGHTNESS, angles=count, spacing_px=4)
