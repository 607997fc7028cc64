"""A few attempts of the real simulated station, for all tests of the browser."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from handsight.collection.collector import CollectSettings, collect
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStationFactory
from handsight.datasets import GraspDataset, GraspRepository

ATTEMPTS = 12


@pytest.fixture(scope="session")
def collected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve attempts on blocks, which nobody changes."""
    path = tmp_path_factory.mktemp("browsed") / "grasps"
    factory = SimStationFactory(config=SimConfig(objects="blocks-train"))
    collect(GraspRepository.create(path), factory, CollectSettings(attempts=ATTEMPTS, seed=11, workers=1))
    return path


@pytest.fixture
def dataset(collected: Path, tmp_path: Path) -> GraspDataset:
    """The same, for a test to decide about."""
    shutil.copytree(collected, tmp_path / "grasps")
    return GraspDataset.open(str(tmp_path / "grasps"))
