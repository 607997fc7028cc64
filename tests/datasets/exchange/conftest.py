"""A dataset to export."""

from __future__ import annotations

import pytest
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.curation.curator import Curator
from handsight.datasets.reading.selection import Selection


@pytest.fixture
def dataset(repository: GraspRepository) -> GraspDataset:
    """Two sessions, one of them of a rig, with curation."""
    for header, size in ((make_header(seed=1), 21), (make_header(seed=None, source="ur10", serials=None), 3)):
        record(repository, header, [make_attempt(header, number) for number in range(size)], every=5)
    curator = Curator(repository, author="jo")
    held, empty = (Selection(where=f"outcome == '{outcome}'") for outcome in ("held", "empty"))
    curator.exclude(held, "blurred")
    curator.undo()
    curator.exclude(empty, "dark")
    curator.relabel(held, False, "slipped")
    return GraspDataset.open(str(repository.path))
