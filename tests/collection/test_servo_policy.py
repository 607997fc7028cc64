"""Attempts chosen by a network: what is recorded, what stays random, and that all of it can be repeated."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file
from torch import Tensor

from handsight.cli.errors import CommandError
from handsight.cli.wiring.policies import policy_named, recorded_policy
from handsight.cli.wiring.resimulate import Resimulator
from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.collector import CollectSettings, collect
from handsight.collection.errors import CollectionSettingsError
from handsight.collection.policy import UniformPolicy
from handsight.collection.servo_policy import ServoPolicy
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.format.digest import attempt_digest
from handsight.servoing.homography import InputGrid
from handsight.servoing.objective import ScoreInputs
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.run import WEIGHTS, DataOrigin, save_run
from handsight.training.trainer import TrainSettings


@dataclass(frozen=True)
class Eager:
    """Sure of every grasp: the servo run ends where it began."""

    sha256: str = "eager"

    def __call__(self) -> ScoreInputs:
        def score(inputs: Tensor) -> Tensor:
            return inputs.new_full((len(inputs),), 0.99)

        return score


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The real network with weights from a seed: it prefers something, if nothing sensible."""
    torch.manual_seed(0)
    settings = TrainSettings()
    folder = tmp_path_factory.mktemp("run")
    network = GraspQualityNetwork(settings.network)
    origin = DataOrigin(dataset="none", ref="main", snapshot="", digest="", view="overhead", attempts=0)
    save_run(folder, network, origin=origin, grid=InputGrid(), settings=settings, history=[])
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
    sure = run_attempt(station, replace(policy, open_network=Eager()), 4, attempt_seed(1, 4))
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
        collect(repository, factory, CollectSettings(attempts=6, seed=2, workers=workers, policy=mixed))
        dataset = GraspDataset.open(str(repository.path))
        digests.add(dataset.digest)
    assert len(digests) == 1
    predicted = dataset.attempts["predicted_success"]
    assert 0 < predicted.notna().sum() < 6
    session = dataset.sessions[0]
    assert session.header.config["policy"]["name"] == "servo"
    number = int(predicted.notna().to_numpy().argmax())
    with closing(Resimulator(run)) as resimulate:
        again = resimulate(session.header, number)
    assert again is not None
    assert attempt_digest(again, session.header.station).hex() == dataset.attempts["digest"].iloc[number]
    assert Resimulator()(session.header, number) is None


def test_another_network_does_not_repeat_a_session(tmp_path: Path, run: Path, policy: ServoPolicy) -> None:
    other = shutil.copytree(run, tmp_path / "other")
    weights = load_file(other / WEIGHTS)
    save_file({name: tensor + 1 for name, tensor in weights.items()}, other / WEIGHTS)
    settings = policy.settings()
    assert isinstance(recorded_policy(settings, run), ServoPolicy)
    assert recorded_policy(settings, run).settings() == settings  # type: ignore[union-attr]
    with pytest.raises(CommandError, match="name the run that collected it"):
        recorded_policy(settings, other)


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_that_is_none_is_refused(share: float, policy: ServoPolicy) -> None:
    with pytest.raises(CollectionSettingsError, match="random_share is"):
        replace(policy, random_share=share)
