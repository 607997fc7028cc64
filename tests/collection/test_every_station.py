"""What holds for every station, simulated or a rig: one suite, run on each of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest
from tests.support.emulated_rig import need_ur_rtde, running_rig
from tests.support.rig_files import station_factory

from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.collector import StationFactory
from handsight.collection.errors import UnreachableError
from handsight.collection.policy import Pregrasp, UniformPolicy
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStationFactory
from handsight.collection.station import Station
from handsight.datasets.records import Outcome, SceneObjects
from handsight.servoing.planar import PlanarPose

KINDS = ("sim", "ur10 e-series", "ur10 cb3")
numbers = itertools.count()


@pytest.fixture(scope="module", params=KINDS)
def factory(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[StationFactory]:
    kind: str = request.param
    if kind == "sim":
        yield SimStationFactory(config=SimConfig(shakes=3))
        return
    need_ur_rtde()
    options = ("--generation", kind.split()[1], "--objects", "household-train", "--speed", "8")
    with running_rig(*options, camera=True) as rig:
        yield station_factory(tmp_path_factory.mktemp("rig"), rig)


@pytest.fixture(scope="module")
def station(factory: StationFactory) -> Iterator[Station]:
    opened = factory()
    yield opened
    opened.close()


@pytest.fixture
def begun(station: Station) -> Station:
    """The station at the beginning of an attempt."""
    station.reset(np.random.default_rng(next(numbers)))
    return station


class Fixed:
    """Always the same pose."""

    def __init__(self, pose: PlanarPose) -> None:
        self.pose = pose

    def choose(self, station: Station, scene: SceneObjects | None, rng: np.random.Generator) -> Pregrasp:
        return Pregrasp(pose=self.pose)

    def settings(self) -> dict[str, object]:
        return {"name": "fixed"}


def test_the_factory_describes_the_station_without_opening_it(factory: StationFactory, station: Station) -> None:
    assert station.spec == factory.spec
    assert station.spec.source in ("sim", "ur10")
    assert 0 < station.spec.closed_width_m < station.spec.gripper_stroke_m


def test_an_attempt_begins_at_the_overhead_pose_with_open_jaws(begun: Station) -> None:
    frame = begun.look()
    k = begun.spec.camera.intrinsics
    assert frame.rgb.shape == (k.height, k.width, 3)
    assert frame.depth.shape == (k.height, k.width)
    assert frame.pose_base_tool[2, 3] == pytest.approx(0.5, abs=0.003)
    assert begun.width_m == pytest.approx(begun.spec.gripper_stroke_m, abs=0.002)


def test_depth_is_the_distance_to_the_table(begun: Station) -> None:
    frame = begun.look()
    above_m = begun.spec.camera.pose_base_camera(frame.pose_base_tool)[2, 3]
    assert begun.spec.depth_scale_m * float(np.median(frame.depth)) == pytest.approx(above_m, abs=0.01)


def test_the_gripper_goes_where_it_is_sent_and_says_so(begun: Station) -> None:
    area = begun.workspace
    for x_m, y_m, angle_rad in (
        (area.x_min_m, area.y_max_m, 1.5),
        (area.x_max_m, area.y_min_m, -1.5),
        (0.6, 0.0, 0.0),
    ):
        begun.reach(PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad))
        pose = begun.look().pose_base_tool
        there = PlanarPose.from_pose_base_tool(pose)
        assert (there.x_m, there.y_m) == pytest.approx((x_m, y_m), abs=0.002)
        assert there.angle_rad == pytest.approx(angle_rad, abs=0.01)
        assert pose[2, 3] == pytest.approx(begun.spec.pregrasp_height_m, abs=0.003)


def test_a_pose_out_of_reach_is_refused_and_the_gripper_stays(begun: Station) -> None:
    begun.reach(PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.0))
    before = begun.look().pose_base_tool
    with pytest.raises(UnreachableError):
        begun.reach(PlanarPose(x_m=1.6, y_m=0.0, angle_rad=0.0))
    np.testing.assert_allclose(begun.look().pose_base_tool, before, atol=1e-3)


def test_the_cycle_gives_readings_in_their_order(begun: Station) -> None:
    clock_s = begun.clock_s
    begun.reach(PlanarPose(x_m=0.65, y_m=0.05, angle_rad=0.3))
    descent = begun.descend()
    assert -0.003 <= descent.pose_base_tool[2, 3] < begun.spec.pregrasp_height_m
    assert descent.contact_force_n >= 0
    widths = [begun.close_gripper(), begun.lift(), begun.shake()]
    assert all(0 <= width <= begun.spec.gripper_stroke_m + 1e-3 for width in widths)
    # What is not in the jaws after the lift does not come into them by shaking.
    assert widths[2] <= widths[1] + 0.003
    assert begun.look().pose_base_tool[2, 3] == pytest.approx(0.25, abs=0.005)
    assert begun.clock_s > clock_s


def test_attempts_carry_a_label_and_only_where_they_ran_to_their_end(station: Station) -> None:
    for number in range(3):
        attempt = run_attempt(station, UniformPolicy(), number, attempt_seed(7, number), pregrasp_picture=True)
        assert attempt.outcome in (Outcome.HELD, Outcome.EMPTY)
        assert attempt.failure == ""
        assert (attempt.phase_s >= 0).all()
        assert (attempt.phase_s[2:] > 0).all()
        assert math.isfinite(attempt.gripper.final_m)
        assert attempt.success == (attempt.gripper.final_m > station.spec.closed_width_m)
        assert attempt.pregrasp is not None
        assert attempt.truth_held is None or station.spec.source == "sim"


def test_an_attempt_out_of_reach_is_recorded_as_that_and_the_next_one_runs(station: Station) -> None:
    beyond = Fixed(PlanarPose(x_m=1.6, y_m=0.0, angle_rad=0.0))
    refused = run_attempt(station, beyond, 0, attempt_seed(8, 0))
    assert (refused.outcome, refused.labelled) == (Outcome.UNREACHABLE, False)
    assert refused.failure.startswith("reach: ")
    assert math.isnan(refused.gripper.closed_m)
    assert run_attempt(station, UniformPolicy(), 1, attempt_seed(8, 1)).labelled
