"""Attempts chosen by a network: what is recorded, what stays random, and that all of it can be repeated."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tests.support.scorers import FunctionScorer

from handsight.cli.errors import CommandError
from handsight.cli.wiring.policies import policy_named, recorded_policy
from handsight.cli.wiring.resimulate import Resimulator
from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.collector import CollectSettings, collect, session_header
from handsight.collection.errors import CollectionSettingsError
from handsight.collection.policy import UniformPolicy
from handsight.collection.servo_policy import ServoPolicy
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.format.digest import attempt_digest
from handsight.datasets.format.header import canonical_json
from handsight.servoing.errors import ScoreError
from handsight.servoing.homography import InputGrid
from handsight.servoing.loop import ServoSettings
from handsight.servoing.methods.cem import Cem
from handsight.servoing.methods.global_first import GlobalFirst, GlobalSearch
from handsight.servoing.methods.registry import METHODS
from handsight.servoing.optimiser import Method
from handsight.servoing.sampling import StepRange
from handsight.servoing.scorer import GraspScorer
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.run import DataOrigin, load_run, save_run
from handsight.training.settings import TrainSettings


@dataclass(frozen=True)
class Constant:
    """Gives everything the same score; one that is sure of every grasp ends where it began."""

    score: float = 0.99
    sha256: str = "constant"
    grid: InputGrid = field(default_factory=InputGrid)

    def __call__(self) -> GraspScorer:
        return FunctionScorer(lambda inputs: inputs.new_full((len(inputs),), self.score), self.grid)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The real network with weights from a seed: it prefers something, if nothing sensible."""
    torch.manual_seed(0)
    settings = TrainSettings()
    folder = tmp_path_factory.mktemp("run")
    network = GraspQualityNetwork(settings.network)
    origin = DataOrigin(dataset="none", ref="main", snapshot="", digest="", view="overhead", attempts=0)
    save_run(folder, network, origins=[origin], grid=InputGrid(), settings=settings)
    return folder


@pytest.fixture(scope="module")
def policy(run: Path) -> ServoPolicy:
    made = policy_named("servo", model=run, method=None, random_share=0.0, threshold=None)
    assert isinstance(made, ServoPolicy)
    return made


@pytest.fixture(scope="module")
def station() -> Iterator[SimStation]:
    opened = SimStation(SimConfig())
    yield opened
    opened.close()


def test_a_random_share_of_one_is_the_uniform_policy(station: SimStation, policy: ServoPolicy) -> None:
    alone = run_attempt(station, UniformPolicy(), 3, attempt_seed(1, 3))
    shared = run_attempt(station, replace(policy, random_share=1.0), 3, attempt_seed(1, 3))
    assert math.isnan(shared.predicted_success)
    assert (shared.pregrasp_x_m, shared.pregrasp_angle_rad) == (alone.pregrasp_x_m, alone.pregrasp_angle_rad)
    assert shared.gripper == alone.gripper


def test_a_network_that_is_sure_grasps_where_it_starts(station: SimStation, policy: ServoPolicy) -> None:
    drawn = run_attempt(station, UniformPolicy(), 4, attempt_seed(1, 4))
    sure = run_attempt(station, replace(policy, open_network=Constant()), 4, attempt_seed(1, 4))
    assert sure.predicted_success == pytest.approx(0.99)
    chosen = (sure.pregrasp_x_m, sure.pregrasp_y_m, sure.pregrasp_angle_rad)
    np.testing.assert_allclose(chosen, (drawn.pregrasp_x_m, drawn.pregrasp_y_m, drawn.pregrasp_angle_rad), atol=1e-3)


def test_what_the_network_chose_is_where_the_gripper_went(station: SimStation, policy: ServoPolicy) -> None:
    drawn = run_attempt(station, UniformPolicy(), 5, attempt_seed(1, 5))
    servoed = run_attempt(station, policy, 5, attempt_seed(1, 5))
    assert 0 <= servoed.predicted_success <= 1
    assert (servoed.pregrasp_x_m, servoed.pregrasp_y_m) != (drawn.pregrasp_x_m, drawn.pregrasp_y_m)
    went = servoed.pose_base_tool_grasp[:2, 3]
    np.testing.assert_allclose(went, (servoed.pregrasp_x_m, servoed.pregrasp_y_m), atol=5e-3)
    assert servoed.overhead is not None
    assert drawn.overhead is not None
    assert np.array_equal(servoed.overhead.rgb, drawn.overhead.rgb)


def test_a_session_is_the_same_with_any_number_of_workers_and_again(
    tmp_path: Path, run: Path, policy: ServoPolicy
) -> None:
    factory = SimStationFactory(config=SimConfig())
    mixed = replace(policy, random_share=0.5)
    digests = set()
    for workers in (1, 2):
        repository = GraspRepository.create(tmp_path / str(workers))
        collect(repository, factory, CollectSettings(attempts=4, seed=2, workers=workers, policy=mixed))
        dataset = GraspDataset.open(str(repository.path))
        digests.add(dataset.digest)
    assert len(digests) == 1
    predicted = dataset.attempts["predicted_success"]
    assert 0 < predicted.notna().sum() < 4
    session = dataset.sessions[0]
    assert session.header.config["policy"]["name"] == "servo"
    number = int(predicted.notna().to_numpy().argmax())
    with closing(Resimulator(run)) as resimulate:
        again = resimulate(session.header, number)
    assert again is not None
    assert attempt_digest(again, session.header.station).hex() == dataset.attempts["digest"].iloc[number]
    assert Resimulator()(session.header, number) is None


def test_another_network_does_not_repeat_a_session(tmp_path: Path, run: Path, policy: ServoPolicy) -> None:
    loaded = load_run(run)
    other, wider = tmp_path / "other", tmp_path / "wider"
    rest = {"origins": loaded.origins, "settings": TrainSettings()}
    save_run(wider, loaded.network, grid=InputGrid(crop_px=300), **rest)  # type: ignore[arg-type]
    save_run(other, GraspQualityNetwork(loaded.network.config), grid=loaded.grid, **rest)  # type: ignore[arg-type]
    settings = policy.settings()
    assert isinstance(recorded_policy(settings, run), ServoPolicy)
    assert recorded_policy(settings, run).settings() == settings  # type: ignore[union-attr]
    with pytest.raises(CommandError, match="name the run that collected it"):
        recorded_policy(settings, other)
    with pytest.raises(CommandError, match="'crop_px': 300"):
        recorded_policy(settings, wider)


TUNED: dict[str, Method] = {
    "cem-1": Cem(samples=32, range=StepRange(x_m=0.02)),
    "global": GlobalFirst(search=GlobalSearch(angles=8, rounds=(6,)), then=Cem(samples=64, range=StepRange(y_m=0.03))),
}


@pytest.mark.parametrize("name", TUNED)
def test_a_session_of_a_method_tuned_otherwise_is_repeated_as_it_was(run: Path, policy: ServoPolicy, name: str) -> None:
    tuned = replace(policy, method=replace(METHODS[name], settings=TUNED[name]))
    again = recorded_policy(json.loads(json.dumps(tuned.settings())), run)
    assert isinstance(again, ServoPolicy)
    assert again.method == tuned.method
    assert again.settings() == tuned.settings()
    unknown = tuned.settings() | {"method_settings": {"samples": 32}}
    assert recorded_policy(unknown, run) is None


def test_an_older_session_names_its_method_alone_and_has_the_grid_elsewhere(run: Path, policy: ServoPolicy) -> None:
    settings = policy.settings()
    older = {name: settings[name] for name in ("name", "method", "weights_sha256", "random_share", "half_range_m")}
    older["servo"] = {"threshold": 0.95, "grid": {"crop_px": 400, "size_px": 64}}
    assert recorded_policy(older, run) == policy


def test_everything_that_decides_the_poses_is_in_the_configuration(policy: ServoPolicy) -> None:
    def tuned(**changes: Any) -> ServoPolicy:
        return replace(policy, method=replace(policy.method, settings=Cem(**changes)))

    def digest(one: ServoPolicy) -> str:
        settings = CollectSettings(attempts=1, policy=one)
        return canonical_json(session_header(SimStationFactory(config=SimConfig()), settings).config)

    variants = [
        policy,
        tuned(samples=65),
        tuned(elite=7),
        tuned(iterations=2),
        tuned(max_steps=9),
        tuned(range=StepRange(angle_rad=0.1)),
        replace(policy, random_share=0.1),
        replace(policy, start=UniformPolicy(half_range_m=0.1)),
        replace(policy, servo=ServoSettings(threshold=0.9)),
        replace(policy, open_network=Constant()),
        replace(policy, open_network=Constant(grid=InputGrid(crop_px=300))),
        replace(policy, open_network=Constant(sha256="another")),
    ]
    assert len({digest(one) for one in variants}) == len(variants)


def test_a_network_whose_scores_are_none_ends_the_session_without_a_grasp(tmp_path: Path, run: Path) -> None:
    """It would spoil every attempt alike, so it is no failure of one; what was finished before it stays."""
    loaded, folder = load_run(run), tmp_path / "run"
    first_dense = loaded.network.get_parameter("head.1.weight")
    first_dense[::2], first_dense[1::2] = 3e38, -3e38  # The next layer subtracts infinity from infinity.
    save_run(folder, loaded.network, origins=loaded.origins, grid=loaded.grid, settings=TrainSettings())
    repository = GraspRepository.create(tmp_path / "grasps")
    mixed = policy_named("servo", model=folder, method=None, random_share=0.5, threshold=None)
    settings = CollectSettings(attempts=6, seed=2, workers=1, policy=mixed)
    with pytest.raises(ScoreError, match="1 of 1 score of"):
        collect(repository, SimStationFactory(config=SimConfig()), settings)
    predicted = GraspDataset.open(str(repository.path)).attempts["predicted_success"]
    assert predicted.isna().all()
    assert len(predicted) < 6


def test_a_session_keeps_that_views_were_levelled(run: Path) -> None:
    levelled = policy_named("servo", model=run, method=None, random_share=0.0, threshold=None, level=True)
    assert isinstance(levelled, ServoPolicy)
    assert levelled.servo.level
    again = recorded_policy(levelled.settings(), run)
    assert again == levelled
    plain = policy_named("servo", model=run, method=None, random_share=0.0, threshold=None)
    assert plain != levelled
    assert recorded_policy(plain.settings(), run) == plain


def test_a_run_that_is_replaced_while_it_is_used_is_noticed(tmp_path: Path, run: Path) -> None:
    copy = shutil.copytree(run, tmp_path / "run")
    opened = policy_named("servo", model=copy, method=None, random_share=0.0, threshold=None)
    assert isinstance(opened, ServoPolicy)
    loaded = load_run(copy)
    fresh = GraspQualityNetwork(loaded.network.config)
    save_run(copy, fresh, origins=loaded.origins, grid=loaded.grid, settings=TrainSettings(), overwrite=True)
    with pytest.raises(CommandError, match="holds another network"):
        opened.open_network()


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_that_is_none_is_refused(share: float, policy: ServoPolicy) -> None:
    with pytest.raises(CollectionSettingsError, match="random_share is"):
        replace(policy, random_share=share)
