from __future__ import annotations

import pickle

import numpy as np
import pytest
from tests.support.scripted_station import ScriptedStation

from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStationFactory
from handsight.evaluation.disturbance import KINDS, Disturbance, DisturbedFactory, DisturbedStation
from handsight.evaluation.errors import EvaluationSettingsError


@pytest.mark.parametrize("text", KINDS.values())
def test_a_disturbance_is_written_as_it_is_read(text: str) -> None:
    assert str(Disturbance.parse(text)) == text


@pytest.mark.parametrize(
    "text",
    ["", "hand-eye", "hand-eye:5", "hand-eye:0mm", "hand-eye:-1mm", "hand-eye:101mm", "luck:5mm", "hand-eye:nanmm"],
)
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(EvaluationSettingsError, match=r"disturb is .* hand-eye:5mm or depth-noise:4mm"):
        Disturbance.parse(text)


def test_a_hand_eye_error_moves_the_camera_in_belief_alone() -> None:
    inner = ScriptedStation()
    station = DisturbedStation(inner, Disturbance.parse("hand-eye:5mm"))
    directions = set()
    for seed in range(3):
        station.reset(np.random.default_rng(seed))
        believed, real = station.spec.camera, inner.spec.camera
        offset = believed.x_tool_camera_m - real.x_tool_camera_m, believed.y_tool_camera_m - real.y_tool_camera_m
        assert np.hypot(*offset) == pytest.approx(0.005)
        assert believed.z_tool_camera_m == real.z_tool_camera_m
        np.testing.assert_array_equal(station.look().depth, inner.look().depth)
        directions.add(offset)
    assert len(directions) == 3


def test_depth_noise_has_its_size_and_leaves_what_is_invalid() -> None:
    station = DisturbedStation(ScriptedStation(), Disturbance.parse("depth-noise:4mm"))
    station.reset(np.random.default_rng(0))
    first, second = station.look().depth, station.look().depth
    assert np.std(first.astype(float)) * station.spec.depth_scale_m == pytest.approx(0.004, rel=0.05)
    assert np.mean(first) * station.spec.depth_scale_m == pytest.approx(0.4, abs=0.001)
    assert (first != second).any()
    blind = DisturbedStation(ScriptedStation(depth_m=0.0), Disturbance.parse("depth-noise:4mm"))
    blind.reset(np.random.default_rng(0))
    assert not blind.look().depth.any()


def test_the_scene_is_that_without_disturbance() -> None:
    plain = SimStationFactory(config=SimConfig(objects="blocks-test"))
    factory = DisturbedFactory(open_station=plain, disturbance=Disturbance.parse("hand-eye:5mm"))
    assert pickle.loads(pickle.dumps(factory)) == factory
    assert factory.settings()["disturbance"] == "hand-eye:5mm"
    scenes = []
    for opened in (plain(), factory()):
        scenes.append(opened.reset(np.random.default_rng(5)))
        opened.close()
    assert scenes[0] is not None
    assert scenes[1] is not None
    np.testing.assert_array_equal(scenes[0].pose_base_object, scenes[1].pose_base_object)
    assert scenes[0].target == scenes[1].target
