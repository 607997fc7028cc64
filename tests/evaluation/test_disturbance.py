from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from tests.support.scorers import FunctionScorer
from tests.support.scripted_station import ScriptedStation

from handsight.collection.errors import SceneUnsettledError, UnreachableError
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.collection.station import Pushable
from handsight.datasets.records import StationSpec
from handsight.evaluation.disturbance import EXAMPLES, Disturbance, DisturbedFactory, DisturbedStation
from handsight.evaluation.errors import EvaluationSettingsError
from handsight.evaluation.flaws import NoisyDepth, PushedObject, ShiftedCamera, StereoDepth, TurnedCamera
from handsight.evaluation.trial import Trial, run_trial
from handsight.servoing.loop import ServoSettings
from handsight.servoing.planar import PlanarPose

BLOCKS = SimConfig(objects="blocks-test")
NO_DISTURBANCES = (
    *("", "hand-eye", "hand-eye:5", "hand-eye:-1mm", "hand-eye:nanmm", "hand-eye:mm", "hand-eye:d435", "hand-eye:٣mm"),
    *("luck:5mm", "moved:2deg", "depth-noise:2deg", "depth-noise:5d435", "depth-noise:d415", "hand-eye:5mm,moved:5mm"),
)
HERE = PlanarPose(x_m=0.6, y_m=0.01, angle_rad=0.0)


@dataclass
class PushedStation(ScriptedStation):
    """Remembers what was pushed, and after how many of the poses that were asked for."""

    rests: bool = True
    """Whether it comes to rest."""
    pushed: list[tuple[tuple[float, float], tuple[float, float], int]] = field(default_factory=list)

    def push(self, near_m: tuple[float, float], by_m: tuple[float, float]) -> None:
        self.pushed.append((near_m, by_m, self.calls.count("reach")))
        if not self.rests:
            raise SceneUnsettledError("scripted")


@dataclass(frozen=True)
class RigFactory:
    """Stands for a rig, at whose table nobody pushes."""

    spec: StationSpec = field(default_factory=lambda: ScriptedStation().spec)
    objects_per_scene: int = 0
    pushable: bool = False

    def settings(self) -> dict[str, object]:
        return {}

    def __call__(self) -> ScriptedStation:
        raise AssertionError("opened")


@pytest.mark.parametrize("text", [*EXAMPLES, "hand-eye:0.5deg", "moved:100mm", "hand-eye:20deg", "depth-noise:0.001mm"])
def test_a_disturbance_is_written_as_it_is_read(text: str) -> None:
    assert str(Disturbance.parse(text)) == text
    assert str(Disturbance.parse(f" {text} ")) == text


@pytest.mark.parametrize("text", NO_DISTURBANCES)
def test_anything_else_is_refused_with_every_example(text: str) -> None:
    with pytest.raises(EvaluationSettingsError, match="disturb is ") as caught:
        Disturbance.parse(text)
    assert repr(text) in str(caught.value)
    assert all(example in str(caught.value) for example in EXAMPLES)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("hand-eye:0mm", "at most 100 mm, such as hand-eye:5mm"),
        ("hand-eye:101mm", "at most 100 mm, such as hand-eye:5mm"),
        ("hand-eye:0.0deg", "at most 20 deg, such as hand-eye:2deg"),
        ("hand-eye:20.5deg", "at most 20 deg, such as hand-eye:2deg"),
        ("moved:100.001mm", "at most 100 mm, such as moved:20mm"),
        ("depth-noise:500mm", "at most 100 mm, such as depth-noise:4mm"),
    ],
)
def test_a_size_out_of_range_is_refused_with_its_bounds(text: str, said: str) -> None:
    with pytest.raises(EvaluationSettingsError) as caught:
        Disturbance.parse(text)
    assert str(caught.value).startswith(f"disturb is {text!r}, expected a size of more than 0")
    assert said in str(caught.value)


def test_every_way_of_writing_has_its_flaw_in_its_unit() -> None:
    shifted, turned, pushed, noisy, stereo = (
        Disturbance.parse(text).draw(np.random.default_rng(0)) for text in EXAMPLES
    )
    assert isinstance(shifted, ShiftedCamera)
    assert np.hypot(shifted.x_m, shifted.y_m) == pytest.approx(0.005)
    assert isinstance(turned, TurnedCamera)
    assert np.trace(turned.turned_from_camera) == pytest.approx(1 + 2 * np.cos(np.radians(2)))
    assert isinstance(pushed, PushedObject)
    assert np.hypot(*pushed.push_m) == pytest.approx(0.02)
    assert isinstance(noisy, NoisyDepth)
    assert noisy.deviation_m == 0.004
    assert isinstance(stereo, StereoDepth)
    assert 0.05 <= stereo.noise.subpixel_px <= 0.15


@pytest.mark.parametrize("text", EXAMPLES)
def test_a_trial_is_disturbed_by_its_seed_alone(text: str) -> None:
    """The same again after other trials, so that the loop may be closed in one and open in the other."""
    inner = PushedStation()
    station = DisturbedStation(inner, Disturbance.parse(text))

    def told(seed: int) -> tuple[object, ...]:
        station.reset(np.random.default_rng(seed))
        inner.pushed.clear()
        looks = [station.look().depth.tobytes() for _ in range(2)]
        station.reach(HERE)
        station.reach(HERE)
        return station.spec.camera, looks, tuple(inner.pushed)

    first = told(1)
    assert told(2) != first
    assert told(1) == first


def test_a_hand_eye_error_moves_the_camera_in_belief_alone() -> None:
    inner = ScriptedStation()
    station = DisturbedStation(inner, Disturbance.parse("hand-eye:5mm"))
    directions = set()
    for seed in range(3):
        station.reset(np.random.default_rng(seed))
        believed, real = station.spec.camera, inner.spec.camera
        offset = believed.x_tool_camera_m - real.x_tool_camera_m, believed.y_tool_camera_m - real.y_tool_camera_m
        assert np.hypot(*offset) == pytest.approx(0.005)
        np.testing.assert_array_equal(station.look().depth, inner.look().depth)
        directions.add(offset)
    assert len(directions) == 3


def test_every_look_of_a_trial_has_noise_of_its_own() -> None:
    for text in ("depth-noise:4mm", "depth-noise:d435"):
        station = DisturbedStation(ScriptedStation(), Disturbance.parse(text))
        station.reset(np.random.default_rng(0))
        assert (station.look().depth != station.look().depth).any()


def test_the_push_follows_the_first_move_and_no_other() -> None:
    inner = PushedStation()
    station = DisturbedStation(inner, Disturbance.parse("moved:20mm"))
    for trial in (1, 2):
        station.reset(np.random.default_rng(trial))
        station.reach(PlanarPose(x_m=0.5, y_m=0.0, angle_rad=0.0))
        assert len(inner.pushed) == trial - 1, "the first pose is where the trial starts"
        station.reach(HERE)
        station.reach(PlanarPose(x_m=0.7, y_m=0.0, angle_rad=0.0))
        near_m, by_m, reached = inner.pushed[-1]
        assert (len(inner.pushed), near_m, reached) == (trial, (0.6, 0.01), 2)
        assert np.hypot(*by_m) == pytest.approx(0.02)
    assert inner.pushed[0][1] != inner.pushed[1][1]


def test_a_move_out_of_reach_is_no_move() -> None:
    inner = PushedStation(faults={"reach": 1})
    station = DisturbedStation(inner, Disturbance.parse("moved:20mm"))
    station.reset(np.random.default_rng(0))
    station.reach(HERE)
    with pytest.raises(UnreachableError):
        station.reach(HERE)
    inner.faults.clear()
    assert inner.pushed == []
    station.reach(HERE)
    assert len(inner.pushed) == 1


@pytest.mark.parametrize("one_look", [False, True])
def test_what_does_not_come_to_rest_aborts_the_trial_whether_the_loop_is_closed_or_open(one_look: bool) -> None:
    inner = PushedStation(rests=False)
    station = DisturbedStation(inner, Disturbance.parse("moved:20mm"))
    scorer = FunctionScorer(lambda inputs: torch.full((len(inputs),), 0.5))
    trial, _ = run_trial(station, scorer, "cem-1", 0, seed=1, settings=ServoSettings(), one_look=one_look)
    assert (trial.aborted, trial.failure) == (True, "settle: scripted")
    assert len(inner.pushed) == 1
    assert "descend" not in inner.calls


def test_other_disturbances_push_nothing() -> None:
    inner = PushedStation()
    station = DisturbedStation(inner, Disturbance.parse("hand-eye:5mm"))
    station.reset(np.random.default_rng(0))
    for _ in range(3):
        station.reach(HERE)
    assert inner.pushed == []


def test_a_station_that_cannot_push_is_refused_by_name_before_it_is_opened() -> None:
    moved = Disturbance.parse("moved:20mm")
    said = r"disturb is 'moved:20mm', which pushes an object, and the station 'ur10' cannot .* such as hand-eye:5mm"
    with pytest.raises(EvaluationSettingsError, match=said):
        DisturbedFactory(open_station=RigFactory(), disturbance=moved)
    with pytest.raises(EvaluationSettingsError, match=said):
        DisturbedStation(ScriptedStation(), moved)
    for text in EXAMPLES:
        if not Disturbance.parse(text).pushes:
            DisturbedFactory(open_station=RigFactory(), disturbance=Disturbance.parse(text))


@pytest.mark.parametrize("text", ["hand-eye:5mm", "moved:20mm"])
def test_the_scene_is_that_without_disturbance(text: str) -> None:
    plain = SimStationFactory(config=BLOCKS)
    factory = DisturbedFactory(open_station=plain, disturbance=Disturbance.parse(text))
    assert pickle.loads(pickle.dumps(factory)) == factory
    assert factory.settings()["disturbance"] == text
    assert (factory.spec, factory.objects_per_scene, factory.pushable) == (plain.spec, 5, False)
    scenes = []
    for opened in (plain(), factory()):
        scenes.append(opened.reset(np.random.default_rng(5)))
        opened.close()
    assert scenes[0] is not None
    assert scenes[1] is not None
    np.testing.assert_array_equal(scenes[0].pose_base_object, scenes[1].pose_base_object)
    assert scenes[0].target == scenes[1].target


class WatchedStation(SimStation):
    """Remembers what was pushed, where everything then was, and from where was looked."""

    def __init__(self) -> None:
        super().__init__(BLOCKS)
        self.pushed: list[tuple[tuple[float, float], tuple[float, float]]] = []
        self.moved_m: NDArray[np.float64] = np.zeros(0)

    def push(self, near_m: tuple[float, float], by_m: tuple[float, float]) -> None:
        before = self._scene.poses()
        super().push(near_m, by_m)
        self.pushed.append((near_m, by_m))
        self.moved_m = (self._scene.poses() - before)[:, :2]


@pytest.fixture(scope="module")
def watched() -> Iterator[WatchedStation]:
    station = WatchedStation()
    yield station
    station.close()


def servoed(watched: WatchedStation, number: int, *, one_look: bool, method: str = "cem-1") -> Trial:
    watched.pushed.clear()
    station = DisturbedStation(watched, Disturbance.parse("moved:30mm"))
    # What it prefers depends on the picture, and it is never sure: every step is taken.
    scorer = FunctionScorer(lambda inputs: torch.sigmoid(3 * inputs[:, :, 24:40, 24:40].mean((1, 2, 3)) - 1))
    return run_trial(station, scorer, method, number, seed=7, settings=ServoSettings(), one_look=one_look)[0]


@pytest.mark.parametrize("number", [0, 1, 3])
def test_an_object_is_pushed_alike_whether_the_loop_is_closed_or_open(watched: WatchedStation, number: int) -> None:
    assert isinstance(watched, Pushable)
    closed = servoed(watched, number, one_look=False)
    pushed, moved_m = list(watched.pushed), watched.moved_m
    opened = servoed(watched, number, one_look=True)
    assert (closed.aborted, opened.aborted) == (False, False)
    assert closed.moves > opened.moves == 1
    assert len(pushed) == 1
    assert watched.pushed == pushed
    np.testing.assert_array_equal(watched.moved_m, moved_m)
    distances_m = np.linalg.norm(moved_m, axis=1)
    assert distances_m.max() == pytest.approx(0.03, abs=0.003)
    by_m = pushed[0][1]
    np.testing.assert_allclose(moved_m[distances_m.argmax()], by_m, atol=0.003)


def test_random_grasps_are_not_disturbed_by_it(watched: WatchedStation) -> None:
    assert not servoed(watched, 0, one_look=False, method="random").aborted
    assert watched.pushed == []
