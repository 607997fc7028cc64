"""Randomization: values drawn from the attempt's seed, recorded under names, and seen or felt in the scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from handsight.collection.attempt import AttemptStreams, attempt_seed, run_attempt
from handsight.collection.errors import StationSettingsError
from handsight.collection.policy import UniformPolicy
from handsight.collection.sim.camera import Light
from handsight.collection.sim.config import RANDOMIZED, SimConfig
from handsight.collection.sim.randomization import LampPlace, Randomization, condition_names
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.collection.sim.table_look import PATTERNS, TableLook
from handsight.datasets.records import GraspAttempt


def attempted(number: int, *kinds: str) -> GraspAttempt:
    station = SimStation(SimConfig(vary=kinds))
    try:
        return run_attempt(station, UniformPolicy(), number, attempt_seed(5, number))
    finally:
        station.close()


@pytest.fixture(scope="module")
def plain() -> GraspAttempt:
    return attempted(0)


@pytest.fixture(scope="module")
def varied() -> Iterator[SimStation]:
    station = SimStation(SimConfig(vary=RANDOMIZED))
    yield station
    station.close()


def test_every_value_has_a_name_and_is_recorded(varied: SimStation) -> None:
    names = varied.spec.conditions
    assert len(set(names)) == len(names)
    assert {"table_red", "light_ambient", "colour_blue_4", "friction_objects", "depth_noise_subpixel_px"} <= set(names)
    first, again, other = (run_attempt(varied, UniformPolicy(), n, attempt_seed(5, n)) for n in (0, 0, 1))
    assert first.scene is not None
    assert again.scene is not None
    assert other.scene is not None
    assert first.scene.conditions.shape == (len(names),)
    assert np.array_equal(first.scene.conditions, again.scene.conditions)
    # Two tables may have the same pattern; everything else is a draw from a continuum.
    assert not np.isclose(first.scene.conditions, other.scene.conditions)[names.index("table_pattern") + 1 :].any()
    assert first.overhead is not None
    assert again.overhead is not None
    assert np.array_equal(first.overhead.rgb, again.overhead.rgb)
    assert np.array_equal(first.overhead.depth, again.overhead.depth)


@pytest.mark.parametrize("kind", ["table", "light", "colour", "depth-noise"])
def test_what_is_only_seen_changes_pictures_and_nothing_else(kind: str, plain: GraspAttempt) -> None:
    changed = attempted(0, kind)
    assert plain.overhead is not None
    assert changed.overhead is not None
    rgb_alike = np.array_equal(plain.overhead.rgb, changed.overhead.rgb)
    depth_alike = np.array_equal(plain.overhead.depth, changed.overhead.depth)
    assert (rgb_alike, depth_alike) == ((True, False) if kind == "depth-noise" else (False, True))
    assert plain.scene is not None
    assert changed.scene is not None
    assert np.array_equal(plain.scene.pose_base_object, changed.scene.pose_base_object)
    assert plain.gripper == changed.gripper


def test_friction_is_felt_and_leaves_the_choice_of_objects(plain: GraspAttempt) -> None:
    changed = attempted(0, "friction")
    assert plain.scene is not None
    assert changed.scene is not None
    assert np.array_equal(plain.scene.catalogue_index, changed.scene.catalogue_index)
    assert not np.array_equal(plain.scene.pose_base_object, changed.scene.pose_base_object)


def test_switching_a_kind_on_leaves_what_the_others_draw() -> None:
    def drawn(*kinds: str) -> Randomization:
        return Randomization.draw(kinds, 3, AttemptStreams.from_seed(attempt_seed(1, 2)).scene)

    everything = drawn(*RANDOMIZED)
    assert drawn("light") == Randomization(light=everything.light)
    assert drawn("colour", "friction") == Randomization(tints=everything.tints, friction=everything.friction)
    assert drawn() == Randomization()


@pytest.mark.parametrize("kinds", [(), ("colour",), ("depth-noise", "table"), RANDOMIZED])
def test_names_and_values_go_together(kinds: tuple[str, ...]) -> None:
    randomization = Randomization.draw(kinds, 4, np.random.default_rng(0))
    named = dict(zip(condition_names(kinds, 4), randomization.values(), strict=True))
    if randomization.table is not None:
        assert named["table_seed"] == randomization.table.seed
    if randomization.tints:
        assert named["colour_green_2"] == randomization.tints[2].green
    if randomization.depth_noise is not None:
        assert named["depth_noise_subpixel_px"] == randomization.depth_noise.subpixel_px


@pytest.mark.parametrize("pattern", range(len(PATTERNS)))
def test_tables_have_their_colour_and_contrast(pattern: int) -> None:
    look = TableLook(pattern=pattern, red=120.0, green=90.0, blue=60.0, contrast=0.1, seed=3)
    texture = look.table_top().texture.astype(float)
    np.testing.assert_allclose(texture.mean(axis=(0, 1)), (120, 90, 60), atol=2)
    assert texture[:, :, 0].std() == pytest.approx(12, rel=0.1)
    assert np.array_equal(look.table_top().texture, look.table_top().texture)
    assert not np.array_equal(look.table_top().texture, replace(look, seed=4).table_top().texture)


def test_lamps_give_a_light_that_the_renderer_takes() -> None:
    rng = np.random.default_rng(2)
    lights = [LampPlace.draw(rng).light() for _ in range(200)]
    assert all(np.linalg.norm(light.direction) == pytest.approx(1) and light.direction[2] > 0.4 for light in lights)
    shares = [light.on_table for light in lights]
    assert min(shares) < 0.6 < Light().on_table < max(shares)


@pytest.mark.parametrize("vary", [("colours",), ("light", "light")])
def test_unknown_or_repeated_kinds_are_refused(vary: tuple[str, ...]) -> None:
    with pytest.raises(StationSettingsError, match="expected some of table, light"):
        SimConfig(vary=vary)


def test_more_objects_than_fit_are_refused() -> None:
    most = SimConfig().most_objects
    with pytest.raises(StationSettingsError, match=f"objects_per_scene is {most + 1}, expected at most {most}"):
        SimConfig(objects_per_scene=most + 1)


def test_ten_objects_make_a_heap_that_comes_to_rest() -> None:
    config = SimConfig(objects="clutter-train", objects_per_scene=10)
    station = SimStationFactory(config=config)()
    try:
        scenes = [station.reset(AttemptStreams.from_seed(attempt_seed(0, n)).scene) for n in range(3)]
    finally:
        station.close()
    assert all(scene.pose_base_object.shape == (10, 7) for scene in scenes)
    for scene in scenes:
        apart_m = np.linalg.norm(scene.pose_base_object[:, None, :2] - scene.pose_base_object[None, :, :2], axis=2)
        assert apart_m[np.triu_indices(10, k=1)].min() < 0.06
