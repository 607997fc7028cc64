"""Grasps performed again on a station without physics: what is counted, and what decides it."""

from __future__ import annotations

import math
from typing import Any

import pytest
from tests.support.scripted_station import ScriptedStation

from handsight.collection.recorded_stations import RecordedStations
from handsight.evaluation.errors import EvaluationSettingsError
from handsight.evaluation.repeatability import (
    RecordedGrasp,
    RepeatedGrasp,
    RepeatSettings,
    foreseeable_auc,
    repeat_grasp,
    repeatability_rows,
)
from handsight.servoing.planar import PlanarPose

POSE = PlanarPose(x_m=0.6, y_m=0.01, angle_rad=0.3)
GRASP = RecordedGrasp(attempt="a", number=3, session_seed=7, station={"name": "one"}, pose=POSE, held=True)


class Remembering(ScriptedStation):
    """Knows every pose that it was sent to."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.reached: list[PlanarPose] = []

    def reach(self, pose: PlanarPose) -> None:
        super().reach(pose)
        self.reached.append(pose)


def stations_of(station: ScriptedStation) -> RecordedStations:
    return RecordedStations(lambda settings: station)


def test_poses_are_beside_the_recorded_one_and_follow_from_the_seed() -> None:
    def poses(settings: RepeatSettings, grasp: RecordedGrasp = GRASP) -> list[PlanarPose]:
        station = Remembering()
        repeat_grasp(stations_of(station), grasp, settings=settings)
        return station.reached

    assert poses(RepeatSettings(repeats=2, shift_m=0, turn_rad=0)) == [POSE, POSE]
    drawn = poses(RepeatSettings(repeats=200))
    assert len(set(drawn)) == 200
    assert poses(RepeatSettings(repeats=3)) == drawn[:3]
    assert poses(RepeatSettings(repeats=3, seed=1)) != drawn[:3]
    steps = [POSE.step_to(pose) for pose in drawn]
    for values, deviation in (
        ([step.dx_m for step in steps], 0.001),
        ([step.dy_m for step in steps], 0.001),
        ([step.dangle_rad for step in steps], math.radians(1)),
    ):
        assert math.sqrt(sum(value**2 for value in values) / 200) == pytest.approx(deviation, rel=0.2)
    turned = poses(RepeatSettings(repeats=5, shift_m=0))
    assert {(round(pose.x_m, 12), round(pose.y_m, 12)) for pose in turned} == {(POSE.x_m, POSE.y_m)}


def test_a_repeat_holds_as_the_station_says_or_grasps_nothing() -> None:
    settings = RepeatSettings(repeats=2)
    assert repeat_grasp(stations_of(ScriptedStation()), GRASP, settings=settings).repeats == (True, True)
    lost = ScriptedStation(widths_m=(0.03, 0.0, 0.0))
    assert repeat_grasp(stations_of(lost), GRASP, settings=settings).repeats == (False, False)
    for phase in ("settle", "reach", "descend"):
        broken = ScriptedStation(faults={phase: 0})
        assert repeat_grasp(stations_of(broken), GRASP, settings=settings).repeats == (None, None)


def repeated(held: bool, *repeats: bool | None) -> RepeatedGrasp:
    return RepeatedGrasp(attempt="a", held=held, repeats=repeats)


def test_rows_count_what_ended() -> None:
    grasps = [
        repeated(True, True, True),
        repeated(True, True, False),
        repeated(True, None, None),
        repeated(False, False, None),
    ]
    success, failure = repeatability_rows(grasps)
    assert (success["recorded"], success["attempts"], success["repeats"], success["as_recorded"]) == (
        "success",
        2,
        4,
        3,
    )
    assert (success["rate"], success["always"], success["not_grasped"]) == (0.75, 1, 2)
    assert (failure["recorded"], failure["rate"], failure["always"], failure["not_grasped"]) == ("failure", 1.0, 1, 1)
    (only,) = repeatability_rows([repeated(True, None)])
    assert (only["attempts"], only["rate"], only["always_ci95"]) == (0, None, (0.0, 1.0))


def test_the_share_that_held_is_judged_as_scores_are() -> None:
    grasps = [repeated(True, True, True), repeated(True, True, False), repeated(False, True, False)]
    assert foreseeable_auc(grasps) == pytest.approx(0.75)  # One pair in order, one even.
    assert foreseeable_auc([*grasps, repeated(True, None)]) == pytest.approx(0.75)
    assert foreseeable_auc(grasps[:2]) is None
    assert foreseeable_auc([]) is None


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"repeats": 0}, "repeats is 0, expected 1 or more"),
        ({"shift_m": -0.001}, "shift is -1 mm, expected 0 to 100"),
        ({"shift_m": math.nan}, "shift is nan mm"),
        ({"shift_m": 0.2}, "shift is 200 mm"),
        ({"turn_rad": math.inf}, "turn is inf deg, expected 0 to 90"),
        ({"seed": -1, "workers": 0}, "seed is -1"),
    ],
)
def test_settings_out_of_range_are_refused(change: dict[str, Any], told: str) -> None:
    with pytest.raises(EvaluationSettingsError, match=told):
        RepeatSettings(**change)
