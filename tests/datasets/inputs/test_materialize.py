"""Inputs show as much of the table from whatever height a station looks at it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.datasets.inputs.materialize import grasp_input, materialize
from handsight.datasets.views import input_span_m
from handsight.servoing.homography import InputGrid
from handsight.servoing.planar import PlanarPose

GRID = InputGrid(crop_px=16, size_px=8)


def recorded(path: Path, *heights_m: float) -> GraspDataset:
    """Sessions of two attempts each, of stations that grasp from these heights."""
    repository = GraspRepository.create(path)
    for seed, height_m in enumerate(heights_m, start=1):
        header = make_header(seed=seed, width=16, height=12, pregrasp_height_m=height_m)
        record(repository, header, [make_attempt(header, number, outcome=Outcome.HELD) for number in range(2)])
    return GraspDataset.open(str(path))


def warped(dataset: GraspDataset, grid: InputGrid) -> NDArray[np.float16]:
    """What the inputs should be, one by one."""
    made = []
    for key, row in dataset.attempts.iterrows():
        picture = dataset.attempt(str(key)).overhead
        assert picture is not None
        goal = PlanarPose(x_m=row["pregrasp_x_m"], y_m=row["pregrasp_y_m"], angle_rad=row["pregrasp_angle_rad"])
        made.append(grasp_input(picture, dataset.station(str(key)), goal, grid))
    return np.stack(made).astype(np.float16)


def test_stations_of_one_height_are_taken_as_they_are(tmp_path: Path) -> None:
    dataset = recorded(tmp_path / "grasps", 0.4, 0.4)
    span_m = input_span_m(dataset.sessions[0].header.station, GRID)
    made = materialize(dataset, grid=GRID)
    np.testing.assert_array_equal(made.inputs, warped(dataset, GRID))
    # The same file of inputs serves the network that was trained on it.
    assert materialize(dataset, grid=replace(GRID, span_m=span_m)).file == made.file


def test_stations_of_several_heights_show_what_the_first_one_does(tmp_path: Path) -> None:
    dataset = recorded(tmp_path / "grasps", 0.4, 0.2)
    span_m = input_span_m(dataset.sessions[0].header.station, GRID)
    made = materialize(dataset, grid=GRID).inputs
    np.testing.assert_array_equal(made, warped(dataset, replace(GRID, span_m=span_m)))
    assert (made[2:] != warped(dataset, GRID)[2:]).any()


def test_a_network_of_another_height_is_shown_what_it_learnt_from(tmp_path: Path) -> None:
    dataset = recorded(tmp_path / "rig", 0.2)
    simulated_m = input_span_m(replace(dataset.sessions[0].header.station, pregrasp_height_m=0.4), GRID)
    rig_m = input_span_m(dataset.sessions[0].header.station, GRID)
    assert simulated_m is not None
    assert rig_m is not None
    assert simulated_m / rig_m == pytest.approx((0.4 + 0.113) / (0.2 + 0.113))
    grid = replace(GRID, span_m=simulated_m)
    asked, as_it_is = materialize(dataset, grid=grid), materialize(dataset, grid=GRID)
    np.testing.assert_array_equal(asked.inputs, warped(dataset, grid))
    assert asked.file != as_it_is.file
