"""A dataset to export."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.curation.curator import Curator
from handsight.datasets.reading.selection import Selection


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sessions, one of them of a rig, with curation: what tests get copies of, as making it takes a second."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("recorded") / "grasps")
    for header, size in ((make_header(seed=1), 21), (make_header(seed=None, source="ur10", serials=None), 3)):
        record(repository, header, [make_attempt(header, number) for number in range(size)], every=5)
    curator = Curator(repository, author="jo")
    held, empty = (Selection(where=f"outcome == '{outcome}'") for outcome in ("held", "empty"))
    curator.exclude(held, "blurred")
    curator.undo()
    curator.exclude(empty, "dark")
    curator.relabel(held, False, "slipped")
    return Path(str(repository.path))


@pytest.fixture
def dataset(recorded: Path, tmp_path: Path) -> GraspDataset:
    """Two sessions, one of them of a rig, with curation, for one test alone."""
    return GraspDataset.open(str(shutil.copytree(recorded, tmp_path / "grasps", symlinks=True)))
