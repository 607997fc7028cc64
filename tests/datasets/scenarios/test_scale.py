"""What lets a version of a million attempts answer at once gives the same answers as the whole table."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from tests.support.factories import difference, make_attempt, make_header, record

from benchmarks.floors.million import write_million
from handsight.datasets import GraspDataset, GraspRepository, SessionWriter
from handsight.datasets.curation.curator import Curator
from handsight.datasets.format.arrays import array_at
from handsight.datasets.format.schema import COLUMN_CHUNK_ROWS, PACKED_CHUNK_ROWS
from handsight.datasets.reading.diff import diff_versions
from handsight.datasets.reading.selection import Selection

LONG = COLUMN_CHUNK_ROWS + 20
HEADER = make_header(seed=1, width=2, height=2)


def chunk_rows(dataset: GraspDataset) -> set[int]:
    """Rows in a chunk, over all columns of the first session."""
    group = dataset.repository.root(dataset.snapshot_id)
    session = dataset.sessions[0].ulid
    names = ("attempts/digest", "attempts/failure", "overhead/pose_base_tool")
    return {array_at(group, f"sessions/{session}/{name}").chunks[0] for name in names}


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> GraspRepository:
    """A sealed session longer than one chunk of a recorded column."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("long") / "grasps")
    record(repository, HEADER, [make_attempt(HEADER, number) for number in range(LONG)], every=100)
    return repository


def test_sealing_packs_the_columns_and_resuming_unpacks_them(long: GraspRepository) -> None:
    sealed, *recorded = [GraspDataset(long, ref=entry.snapshot_id) for entry in long.log()[:3]]
    assert chunk_rows(sealed) == {PACKED_CHUNK_ROWS}
    assert [chunk_rows(one) for one in recorded] == [{COLUMN_CHUNK_ROWS}] * 2
    with SessionWriter.resume(long, HEADER) as writer:
        for number in range(LONG, LONG + 3):
            writer.append(make_attempt(HEADER, number))
    resumed = GraspDataset(long, ref="main")
    assert chunk_rows(resumed) == {COLUMN_CHUNK_ROWS}
    writer.seal()
    again = GraspDataset(long, ref="main")
    assert chunk_rows(again) == {PACKED_CHUNK_ROWS}
    assert again.digest == resumed.digest
    for number in (0, COLUMN_CHUNK_ROWS - 1, COLUMN_CHUNK_ROWS, LONG - 1, LONG, LONG + 2):
        for dataset in (resumed, again):
            identity = dataset.attempts.index[number]
            assert difference(dataset.attempt(identity), make_attempt(HEADER, number)) is None


def test_a_short_session_stays_as_it_is(repository: GraspRepository) -> None:
    header = make_header()
    record(repository, header, [make_attempt(header, number) for number in range(3)])
    assert chunk_rows(GraspDataset(repository, ref="main")) == {COLUMN_CHUNK_ROWS}


@pytest.fixture(scope="module")
def curated(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    """Three sessions, one without attempts in the table's last rows, with decisions."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("curated") / "grasps")
    for seed, size in ((1, 9), (2, 2), (3, 7)):
        header = make_header(seed=seed)
        record(repository, header, [make_attempt(header, number) for number in range(size)])
    curator = Curator(repository, author="jo")
    curator.exclude(Selection(where="number > 4"), "late")
    curator.relabel(Selection(where="outcome == 'held'"), False, "slipped")
    return GraspDataset(repository, ref="main")


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 18, 100])
def test_the_tail_is_the_end_of_the_table(curated: GraspDataset, count: int) -> None:
    pd.testing.assert_frame_equal(curated.tail(count), curated.attempts.tail(count))


def test_some_columns_are_those_of_the_table(curated: GraspDataset) -> None:
    for name in curated.attempts.columns:
        pd.testing.assert_frame_equal(curated.table(name), curated.attempts[[name]])
    both = curated.table("digest", "excluded")
    pd.testing.assert_frame_equal(both, curated.attempts[["digest", "excluded"]])
    with pytest.raises(KeyError):
        curated.table("nonsense")


def test_some_rows_are_those_of_the_table(curated: GraspDataset) -> None:
    wanted = curated.attempts.index[[11, 0, 8, 9]].tolist()
    expected = curated.attempts.loc[curated.attempts.index.isin(wanted)]
    pd.testing.assert_frame_equal(curated.rows([*wanted, wanted[0], f"{wanted[0][:-6]}000099"]), expected)
    assert curated.rows([]).empty


def test_a_generated_dataset_is_like_a_recorded_one(tmp_path: Path) -> None:
    repository = write_million(tmp_path / "grasps", sessions=3, attempts=40)
    dataset = GraspDataset(repository, ref="main")
    info = dataset.info()
    table = dataset.attempts
    assert (info.attempts, info.sessions) == (120, 3)
    assert info.successes == int(table["success"].sum()) > 0
    assert info.objects == {name: int((table["target"] == name).sum()) for name in info.objects}
    diff = diff_versions(GraspDataset(repository, ref=repository.log()[1].snapshot_id), dataset)
    assert list(diff.added) == table.index[80:].tolist()
    assert diff.balance_after.successes == info.successes
