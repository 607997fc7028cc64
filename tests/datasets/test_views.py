"""Maps over a picture judge a grasp as the network input made of the picture is judged."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tests.support.factories import make_station
from tests.support.networks import trained_looking

from handsight.datasets.inputs.materialize import grasp_input
from handsight.datasets.records import RgbdFrame
from handsight.datasets.views import grasp_plane_m, station_view
from handsight.servoing.homography import InputGrid
from handsight.servoing.objective import Objective
from handsight.servoing.planar import PlanarPose
from handsight.training.gqn import GqnConfig
from handsight.training.scorer import Scorer

STATION = make_station(width=64, height=48, pregrasp_height_m=0.4)
LOOKED_FROM = PlanarPose(x_m=0.6, y_m=0.1, angle_rad=0.3)


def frame(height_m: float = 0.5) -> RgbdFrame:
    rng = np.random.default_rng(0)
    depth = np.full((48, 64), 600, np.uint16)
    depth[10:30, 20:40] = 550
    rgb = rng.integers(0, 256, (48, 64, 3), dtype=np.uint8)
    return RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=LOOKED_FROM.pose_base_tool(height_m))


@pytest.mark.parametrize("height_m", [0.4, 0.5])
def test_a_step_is_scored_as_the_input_that_training_makes_of_it(height_m: float) -> None:
    grid = InputGrid(crop_px=40, size_px=16)
    scorer = Scorer(trained_looking(GqnConfig(widths=(8, 8), kernels=(3, 3), dense=(16,), size_px=16)), grid)
    taken = frame(height_m)
    view = station_view(taken, STATION)
    goal = PlanarPose(x_m=0.62, y_m=0.12, angle_rad=-0.1)
    planar = LOOKED_FROM.step_to(goal)
    step = torch.tensor([[planar.dx_m, planar.dy_m, planar.dangle_rad]], dtype=torch.float32)
    expected = scorer(torch.from_numpy(grasp_input(taken, STATION, goal, grid))[None])
    objective = Objective(view, scorer, view_plane_m=grasp_plane_m(view, taken, STATION))
    assert float(objective(step)[0]) == pytest.approx(float(expected[0]), abs=1e-5)


def test_heights_that_cannot_be_those_of_the_picture_are_left_out() -> None:
    mean_m = 0.6 - 0.05 * (20 * 20) / (48 * 64)
    expected_m = pytest.approx(mean_m - 0.1, abs=1e-5)  # The picture was taken so far above where grasps begin.
    assert grasp_plane_m(station_view(frame(), STATION), frame(), STATION) == expected_m
    for height_m in (5.0, -3.0):
        assert grasp_plane_m(station_view(frame(), STATION), frame(height_m), STATION) is None
