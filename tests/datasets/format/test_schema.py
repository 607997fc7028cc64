"""The axes of what a dataset is made of."""

from __future__ import annotations

import zarr
from tests.support.axes import arrays_of, assert_axes_are_named, axes_of
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.curation.curator import Curator
from handsight.datasets.curation.folds import make_folds
from handsight.datasets.format.schema import COLUMN_CHUNK_ROWS, SESSION_AXES
from handsight.datasets.reading.selection import Selection
from handsight.datasets.writing.writer import SessionWriter


def test_every_axis_has_a_name(repository: GraspRepository) -> None:
    """As recorded, packed, curated, divided into folds and opened again for more."""
    long = make_header(seed=1, width=4, height=3)
    record(repository, long, [make_attempt(long, number) for number in range(COLUMN_CHUNK_ROWS + 2)], every=200)
    Curator(repository, author="jo").exclude(Selection(where="outcome == 'held'"), "dark")
    make_folds(repository, "a", by="object", count=2, seed=0, author="jo")
    assert_axes_are_named(GraspDataset(repository, ref="main").root)
    with SessionWriter.resume(repository, long) as writer:
        writer.append(make_attempt(long, COLUMN_CHUNK_ROWS + 2))
    root = GraspDataset(repository, ref="main").root
    assert_axes_are_named(root)
    session = root[f"sessions/{writer.session}"]
    assert isinstance(session, zarr.Group)
    assert {path: axes_of(array) for path, array in arrays_of(session).items()} == SESSION_AXES
