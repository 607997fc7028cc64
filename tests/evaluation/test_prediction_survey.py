"""Surveys on a station without physics, whose table is bare, and on the simulated one."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
import torch
from tests.support.scorers import FunctionScorer
from tests.support.scripted_station import ScriptedStation

from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation
from handsight.evaluation.errors import EvaluationSettingsError
from handsight.evaluation.prediction_survey import EDGES, SceneSurvey, SurveySettings, survey_scene
from handsight.servoing.homography import InputGrid

SMALL = InputGrid(crop_px=32, size_px=16)
CONSTANT = FunctionScorer(lambda inputs: torch.full((len(inputs),), 0.25), SMALL)
HIGHEST = FunctionScorer(lambda inputs: torch.sigmoid(-20 * inputs[:, 3, 24:40, 24:40].amin((1, 2))))


def test_a_scene_has_a_step_of_every_size() -> None:
    scene = survey_scene(ScriptedStation(), CONSTANT, 0, seed=1)
    assert scene.failure == ""
    kinds = [(sample.kind, sample.size) for sample in scene.samples]
    bins = [(kind, ends) for kind, edges in EDGES.items() for ends in pairwise(edges)]
    assert len(kinds) == len(bins)
    for (kind, size), (expected, (low, high)) in zip(kinds, bins, strict=True):
        assert kind == expected
        assert low <= size < high


def test_a_level_scene_has_its_height_and_no_error() -> None:
    for sample in survey_scene(ScriptedStation(), CONSTANT, 0, seed=1).samples:
        assert sample.height_m == pytest.approx(0.1, abs=1e-6)  # Depth says 0.4 m; the camera hangs at 0.5 m.
        assert max(sample.error.colour_rms, sample.error.height_rms_m) < 1e-6
        assert sample.error.score_error == 0


@pytest.mark.parametrize(
    ("changes", "reason"),
    [({"faults": {"settle": 0}}, "settle: scripted"), ({"depth_m": 0.0}, "no pixel of the depth picture is valid")],
)
def test_a_scene_that_cannot_be_looked_at_says_why(changes: dict[str, Any], reason: str) -> None:
    scene = survey_scene(ScriptedStation(**changes), CONSTANT, 0, seed=1)
    assert scene.samples == ()
    assert reason in scene.failure


def test_scores_that_are_none_fail_the_scene() -> None:
    broken = FunctionScorer(lambda inputs: torch.full((len(inputs),), math.nan), SMALL)
    assert "not in [0, 1]" in survey_scene(ScriptedStation(), broken, 0, seed=1).failure


def test_steps_that_begin_out_of_reach_are_counted_and_the_others_are_taken() -> None:
    scene = survey_scene(ScriptedStation(faults={"reach": 4}), CONSTANT, 0, seed=1)
    assert len(scene.samples) == 3
    assert scene.unreachable == 6


@pytest.mark.parametrize("field", ["scenes", "workers"])
def test_settings_out_of_range_are_refused(field: str) -> None:
    with pytest.raises(EvaluationSettingsError, match=f"{field} is 0, expected 1 or more"):
        SurveySettings(**{"scenes": 1, field: 0})


@pytest.fixture(scope="module")
def scenes() -> list[SceneSurvey]:
    station = SimStation(SimConfig(objects="blocks-test"))
    try:
        return [survey_scene(station, HIGHEST, number, seed=5) for number in (0, 1, 2, 1)]
    finally:
        station.close()


def test_simulated_scenes_depend_on_their_number_alone(scenes: list[SceneSurvey]) -> None:
    assert scenes[1] == scenes[3]
    assert scenes[1].samples != scenes[2].samples


def test_in_simulation_small_steps_are_predicted_better_than_large_ones(scenes: list[SceneSurvey]) -> None:
    for scene in scenes:
        assert scene.failure == ""
        moved = [sample for sample in scene.samples if sample.kind == "move"]
        assert moved[0].error.height_rms_m < moved[-1].error.height_rms_m
        assert moved[0].error.faults.occluded <= moved[-1].error.faults.occluded
        assert len({sample.height_m for sample in scene.samples}) == 1
