"""Every position of a picture at one angle, against crop by crop."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.drawn_table import BRIGHTNESS, CAMERA, DISTANCE_M, GRID, START, DrawnTable
from tests.support.scorers import FunctionScorer

from handsight.servoing.errors import ScoreError, ServoSettingsError
from handsight.servoing.footprint import Footprint
from handsight.servoing.objective import Objective
from handsight.servoing.scorer import MapScorer
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.scorer import Scorer


@pytest.fixture(scope="module")
def network_scorer() -> Scorer:
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(0)
        config = GqnConfig(widths=(8, 8), kernels=(5, 3), dense=(16,), size_px=GRID.size_px)
        return Scorer(GraspQualityNetwork(config).eval(), GRID)


@settings(max_examples=25)
@given(angle_rad=st.floats(-math.pi, math.pi), every=st.integers(1, 5))
@pytest.mark.parametrize("mapped", [True, False])
def test_a_sweep_is_what_its_steps_score(network_scorer: Scorer, angle_rad: float, every: int, *, mapped: bool) -> None:
    view, _ = DrawnTable(START).look()
    scorer = network_scorer if mapped else FunctionScorer(network_scorer, GRID)
    assert isinstance(scorer, MapScorer) == mapped
    objective = Objective(view, scorer)
    swept = objective.sweep(angle_rad, every=every)
    one_by_one = objective(swept.steps.reshape(-1, 3)).reshape(swept.scores.shape)
    torch.testing.assert_close(swept.scores, one_by_one, rtol=0, atol=1e-4)


@pytest.mark.parametrize("share", [0.6, 1.4])
def test_a_sweep_from_another_height_is_what_its_steps_score(network_scorer: Scorer, share: float) -> None:
    """A network that was trained on pictures which show less of the table, or more."""
    grid = replace(GRID, span_m=share * GRID.crop_px * DISTANCE_M / CAMERA.intrinsics.fx)
    view, _ = DrawnTable(START).look()
    here = Objective(view, network_scorer)
    objective = Objective(view, FunctionScorer(network_scorer, grid))
    assert (objective.inputs_here() != here.inputs_here()).any()
    swept = objective.sweep(0.7, every=2)
    one_by_one = objective(swept.steps.reshape(-1, 3)).reshape(swept.scores.shape)
    torch.testing.assert_close(swept.scores, one_by_one, rtol=0, atol=1e-4)


@given(angle_rad=st.floats(-math.pi, math.pi), every=st.integers(1, 4))
def test_a_sweep_covers_the_picture(angle_rad: float, every: int) -> None:
    """Wherever in the picture, the next position of the lattice is at most half a spacing away along either axis."""
    view, _ = DrawnTable(START).look()
    swept = Objective(view, BRIGHTNESS).sweep(angle_rad, every=every)
    footprint = Footprint.of(CAMERA, plane_m=DISTANCE_M)
    pitch_m = every * GRID.crop_px / GRID.size_px * DISTANCE_M / CAMERA.intrinsics.fx
    for x_m in (footprint.x_min_m, 0.0, footprint.x_max_m):
        for y_m in (footprint.y_min_m, 0.0, footprint.y_max_m):
            away_m = (swept.steps[..., :2] - torch.tensor([x_m, y_m])).norm(dim=-1).min()
            # The corner of a cell, or where half a cell is left over at the edge.
            assert float(away_m) <= pitch_m / math.sqrt(2) + 1e-6
    assert bool((swept.inside == footprint.contains(swept.steps)).all())


def test_impossible_sweeps() -> None:
    view, _ = DrawnTable(START).look()
    objective = Objective(view, BRIGHTNESS)
    for angle_rad, every in ((math.nan, 1), (0.0, 0)):
        with pytest.raises(ServoSettingsError, match="expected 1 or more and finite"):
            objective.sweep(angle_rad, every=every)
    bad = FunctionScorer(lambda inputs: torch.full((len(inputs),), torch.nan), GRID)
    with pytest.raises(ScoreError):
        Objective(view, bad).sweep(0.0)


def test_a_footprint_is_what_the_camera_sees() -> None:
    footprint = Footprint.of(CAMERA, plane_m=DISTANCE_M)
    corner = torch.tensor([[footprint.x_min_m, footprint.y_max_m, 0.3], [footprint.x_max_m + 0.1, 0.0, 0.3]])
    assert footprint.contains(corner).tolist() == [True, False]
    clamped = footprint.clamped(corner)
    assert bool(footprint.contains(clamped).all())
    assert clamped[:, 2].tolist() == corner[:, 2].tolist()
