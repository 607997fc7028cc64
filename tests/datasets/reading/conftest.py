"""A dataset of two sessions."""

from __future__ import annotations

import pytest
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository


@pytest.fixture
def dataset(repository: GraspRepository) -> GraspDataset:
    """Two sessions, 24 and 3 attempts of every outcome."""
    for seed, size in ((1, 24), (2, 3)):
        header = make_header(seed=seed)
        record(repository, header, [make_attempt(header, number) for number in range(size)], every=5)
    return GraspDataset.open(str(repository.path))
