"""The paper's cycle on the real simulator."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

from handsight.collection.attempt import (
    AttemptProgress,
    AttemptStreams,
    attempt_seed,
    begin_attempt,
    run_attempt,
)
from handsight.collection.errors import ObjectSetError, SceneUnsettledError, StationSettingsError, UnreachableError
from handsight.collection.policy import Pregrasp, UniformPolicy
from handsight.collection.sim.config import MOST_REDRAWS, SimConfig
from handsight.collection.sim.station import UNSETTLED_SCENES, SimStation, SimStationFactory
from handsight.collection.station import Pushable, SeesObjects
from handsight.datasets.records import PHASES, GraspAttempt, Outcome, RgbdFrame, SceneObjects
from handsight.servoing.planar import PlanarPose

CLOCK_TIMES = {"started_ns", "elapsed_ns"}


@pytest.fixture(scope="module")
def station() -> Iterator[SimStation]:
    opened = SimStation(SimConfig())
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def forty(station: SimStation) -> list[GraspAttempt]:
    """Attempts enough to hold some and to touch many."""
    return [attempt(station, number) for number in range(20, 60)]


class Fixed:
    """A policy that always chooses the same pose."""

    def __init__(self, pose: PlanarPose) -> None:
        self.pose = pose

    def choose(self, station: object, scene: SceneObjects | None, rng: np.random.Generator) -> Pregrasp:
        return Pregrasp(pose=self.pose)


def content(record: Any) -> Any:
    """A record as nested tuples of bytes, without clock times: equal only if everything is equal bit for bit."""
    if is_dataclass(record):
        return tuple(content(getattr(record, f.name)) for f in fields(record) if f.name not in CLOCK_TIMES)
    return record.tobytes() if isinstance(record, np.ndarray) else repr(record)


def attempt(station: SimStation, number: int, policy: Any = None, **options: Any) -> GraspAttempt:
    return run_attempt(station, policy or UniformPolicy(), number, attempt_seed(5, number), **options)


def test_an_attempt_depends_on_its_seed_alone(station: SimStation) -> None:
    """Bit for bit the same, whatever the station did before, and in a station of its own."""
    first = [content(attempt(station, number)) for number in range(6)]
    again = content(attempt(station, 4))
    fresh = SimStation(SimConfig())
    try:
        elsewhere = content(attempt(fresh, 2))
    finally:
        fresh.close()
    assert again == first[4]
    assert elsewhere == first[2]
    assert len(set(first)) == 6


def test_scene_and_grasp_are_drawn_from_separate_streams(station: SimStation) -> None:
    """Another policy meets the same scene, so policies and servo methods can be compared in pairs."""
    uniform, fixed = attempt(station, 1), attempt(station, 1, Fixed(PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.2)))
    assert uniform.scene is not None
    assert fixed.scene is not None
    assert content(uniform.scene) == content(fixed.scene)
    assert content(uniform.overhead) == content(fixed.overhead)


def test_labels_agree_with_simulator_truth(forty: list[GraspAttempt]) -> None:
    labelled = [one for one in forty if one.labelled]
    assert len(labelled) >= 38
    held = [one.outcome is Outcome.HELD for one in labelled]
    assert any(held)
    assert not all(held)
    assert sum(one.truth_held == label for one, label in zip(labelled, held, strict=True)) >= len(labelled) - 1


def test_contact_is_no_more_than_a_robot_bears(forty: list[GraspAttempt]) -> None:
    """Without the slide and the slow end of the descent most contacts are of more than 100 N."""
    forces_n = [one.contact_force_n for one in forty]
    touched = [force_n for force_n in forces_n if force_n > 0]
    assert len(touched) >= 10
    assert all(SimConfig().contact_force_n <= force_n <= 60 for force_n in touched)


def test_the_arm_stops_above_what_stands_under_its_elbow() -> None:
    """A hammer on its head, 0.24 m tall, is met by the forearm while the fingers are still above the table."""
    station = SimStation(SimConfig(objects="household-train"))
    try:
        recorded = run_attempt(station, UniformPolicy(), 6634, attempt_seed(0, 6634))
        begin_attempt(
            AttemptProgress(station=station), UniformPolicy(), AttemptStreams.from_seed(attempt_seed(0, 6634))
        )
        assert station.descend().touched_by == "arm"
    finally:
        station.close()
    assert recorded.outcome is Outcome.EMPTY
    assert recorded.contact_force_n < 150


def test_a_scene_that_does_not_settle_is_drawn_again_and_counted() -> None:
    """With so little time about half of the scenes settle; the next is drawn by the attempt's own generator."""
    hasty = SimStation(SimConfig(settle_limit_s=0.8))
    try:
        counted = []
        for seed in range(8):
            scene, again = hasty.reset(np.random.default_rng(seed)), hasty.reset(np.random.default_rng(seed))
            assert content(scene) == content(again)
            assert hasty.clock_s <= 0.8
            counted.append(int(scene.conditions[0]))
    finally:
        hasty.close()
    assert hasty.spec.conditions == (UNSETTLED_SCENES,)
    assert any(counted)
    assert not all(counted)


def test_the_wider_gripper_opens_wider_and_the_session_says_so() -> None:
    factory = SimStationFactory(config=SimConfig(gripper="2f-140"))
    wide = factory()
    try:
        recorded = attempt(wide, 3)
    finally:
        wide.close()
    assert recorded.gripper.before_m == pytest.approx(0.14, abs=1e-3)
    assert factory.spec.gripper_stroke_m == 0.14
    assert (factory.settings()["gripper"], factory.settings()["gripper_stroke_m"]) == ("2f-140", 0.14)


def test_a_grasp_over_an_object_lifts_it(station: SimStation) -> None:
    """Straight over a narrow object along its thin side: the grasp holds and the readings say so."""
    held = next(one for one in (attempt(station, number) for number in range(60)) if one.outcome is Outcome.HELD)
    assert held.truth_held
    assert held.gripper.before_m == pytest.approx(0.085, abs=1e-3)
    assert 0.002 < held.gripper.final_m < held.gripper.before_m
    assert held.overhead is not None
    assert held.overhead.pose_base_tool[2, 3] == pytest.approx(0.5, abs=1e-3)


def test_phases_take_simulated_time(station: SimStation) -> None:
    seconds = dict(zip(PHASES, attempt(station, 3).phase_s.tolist(), strict=True))
    assert 0.3 < seconds["settle"] <= 5.0
    assert seconds["look"] == 0.0
    assert seconds["shake"] < 0.01
    for phase in ("reach", "descend", "close", "lift"):
        assert 0.1 < seconds[phase] < 3.0


def test_shakes_are_done_when_asked_for() -> None:
    shaking = SimStation(SimConfig(shakes=3))
    try:
        assert attempt(shaking, 3).phase_s[PHASES.index("shake")] > 0.3
    finally:
        shaking.close()


def test_a_picture_at_the_pregrasp_pose_is_taken_on_request(station: SimStation) -> None:
    without, taken = attempt(station, 7), attempt(station, 7, pregrasp_picture=True)
    assert without.pregrasp is None
    assert taken.pregrasp is not None
    expected = PlanarPose(
        x_m=taken.pregrasp_x_m, y_m=taken.pregrasp_y_m, angle_rad=taken.pregrasp_angle_rad
    ).pose_base_tool(0.4)
    np.testing.assert_allclose(taken.pregrasp.pose_base_tool, expected, atol=2e-3)


def test_out_of_reach_is_recorded_not_faked(station: SimStation) -> None:
    far = attempt(station, 0, Fixed(PlanarPose(x_m=1.4, y_m=0.0, angle_rad=0.0)))
    assert far.outcome is Outcome.UNREACHABLE
    assert "1.400" in far.failure
    assert far.overhead is not None
    assert not far.labelled
    assert far.truth_held is None
    assert np.isnan(far.gripper.final_m)
    assert np.isnan(far.pose_base_tool_grasp).all()


def test_an_unreachable_move_leaves_the_arm_where_it_is(station: SimStation) -> None:
    station.reset(np.random.default_rng(0))
    before = station.look().pose_base_tool
    with pytest.raises(UnreachableError):
        station.reach(PlanarPose(x_m=2.0, y_m=0.0, angle_rad=0.0))
    np.testing.assert_array_equal(station.look().pose_base_tool, before)


def test_a_descent_says_what_it_ended_on_and_the_station_where_objects_are(station: SimStation) -> None:
    """Fingers beside the middle of an object by half of the opening come down on it."""
    assert isinstance(station, SeesObjects)
    scene = station.reset(np.random.default_rng(4))
    before_m = station.object_positions_m()
    np.testing.assert_allclose(before_m, scene.pose_base_object[:, :3], atol=1e-9)
    x_m, y_m = before_m[scene.target, :2].tolist()
    station.reach(PlanarPose(x_m=x_m + 0.0425, y_m=y_m, angle_rad=0.0))
    descent = station.descend()
    assert descent.contact_force_n > 0
    assert descent.touched_by == "finger"
    station.push((x_m, y_m), (0.04, 0.0))
    moved_m = np.linalg.norm(station.object_positions_m() - before_m, axis=1)
    assert moved_m[scene.target] > 0.02


def test_what_is_pushed_moves_in_the_picture_and_the_arm_does_not(station: SimStation) -> None:
    assert isinstance(station, Pushable)
    assert SimStationFactory(config=SimConfig()).pushable

    def pushed() -> tuple[RgbdFrame, RgbdFrame, float]:
        scene = station.reset(np.random.default_rng(4))
        x_m, y_m = scene.pose_base_object[scene.target, :2].tolist()
        station.reach(PlanarPose(x_m=x_m, y_m=y_m, angle_rad=0.3))
        before, began_s = station.look(), station.clock_s
        station.push((x_m, y_m), (0.04, 0.0))
        return before, station.look(), station.clock_s - began_s

    before, after, took_s = pushed()
    np.testing.assert_allclose(after.pose_base_tool, before.pose_base_tool, atol=1e-3)
    # The object under the gripper is nearer than the table, and 40 mm are dozens of pixels.
    assert (np.abs(after.depth.astype(int) - before.depth) > 10).sum() > 500
    assert 0.4 <= took_s <= 5.0
    assert content(pushed()[1]) == content(after)


def test_objects_that_never_rest_abort_the_attempt() -> None:
    hasty = SimStation(SimConfig(settle_limit_s=0.1))
    try:
        with pytest.raises(SceneUnsettledError, match=rf"settle: .*0\.1 s, .* in {MOST_REDRAWS + 1} scenes"):
            hasty.reset(np.random.default_rng(0))
        recorded = attempt(hasty, 0)
    finally:
        hasty.close()
    assert recorded.outcome is Outcome.ABORTED
    assert recorded.failure.startswith("settle: ")
    assert recorded.overhead is None


def test_the_factory_describes_its_stations_without_opening_one(station: SimStation) -> None:
    assert SimStationFactory(config=SimConfig()).spec == station.spec


def test_bad_settings_report_every_fault() -> None:
    with pytest.raises(StationSettingsError) as caught:
        SimConfig(objects_per_scene=0, shakes=-1, lift_height_m=0.6, physics_hz=10)
    for part in ("objects_per_scene is 0", "shakes is -1", "heights", "10 Hz"):
        assert part in str(caught.value)


def test_unknown_object_sets_name_the_known_ones() -> None:
    with pytest.raises(ObjectSetError, match="blocks-train"):
        SimStation(SimConfig(objects="blorks"))


def test_more_objects_than_the_set_has_are_refused() -> None:
    with pytest.raises(ObjectSetError, match="10 objects"):
        SimStation(SimConfig(objects="household-test", objects_per_scene=11))


def test_the_station_takes_household_objects() -> None:
    station = SimStation(SimConfig(objects="household-test"))
    try:
        scene: SceneObjects = station.reset(np.random.default_rng(3))
        picture = station.look()
    finally:
        station.close()
    assert len(scene.catalogue_index) == 5
    assert station.spec.objects[0] == "household/milk-jug"
    # Objects are nearer than the table, and there are colours that no wooden table has.
    assert picture.depth.min() < picture.depth.max() - 15
    assert (picture.rgb.max(axis=2).astype(int) - picture.rgb.min(axis=2) > 120).sum() > 200


def test_an_object_that_slipped_and_still_falls_is_not_held(station: SimStation) -> None:
    """A toothbrush is in mid-air as the lift ends, and no finger is near it."""
    recorded = run_attempt(station, UniformPolicy(), 32, attempt_seed(777, 32))
    assert recorded.outcome is Outcome.EMPTY
    assert not recorded.truth_held
