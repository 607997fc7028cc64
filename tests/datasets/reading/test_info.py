"""What a dataset is, in a dozen numbers, read without its pictures."""

from __future__ import annotations

from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository, Outcome


def test_info_leaves_caches_out_of_the_size(repository: GraspRepository) -> None:
    before = GraspDataset.open(str(repository.path)).info().bytes
    assert before == sum(path.stat().st_size for path in repository.folder.rglob("*") if path.is_file())
    (repository.folder / ".handsight").mkdir()
    (repository.folder / ".handsight" / "cache").write_bytes(b"x" * 1000)
    assert GraspDataset.open(str(repository.path)).info().bytes == before


def test_a_file_that_goes_away_while_bytes_are_counted_is_none(dataset: GraspDataset) -> None:
    before = dataset.info().bytes
    (dataset.repository.folder / "chunks" / "ABC#1").symlink_to("renamed since")
    assert dataset.info().bytes == before


def test_info_counts(dataset: GraspDataset) -> None:
    info = dataset.info()
    table = dataset.attempts
    assert (info.attempts, info.sessions, info.excluded) == (27, 2, 0)
    assert info.outcomes == {name: int((table["outcome"] == name).sum()) for name in info.outcomes}
    assert list(info.outcomes) == ["empty", "held", "unreachable", "aborted"]
    assert info.successes == info.outcomes["held"] == int(table["success"].sum())
    assert sum(info.objects.values()) == int(table["target"].notna().sum())
    assert list(info.objects) == ["apple", "bolt", "cup", "duck", "egg"]
    assert (info.snapshot, info.digest) == (dataset.snapshot_id, dataset.digest)


def test_info_and_the_table_read_no_pictures(repository: GraspRepository) -> None:
    header = make_header(width=64, height=48)
    record(repository, header, [make_attempt(header, 0, outcome=Outcome.HELD)])
    expected = GraspDataset.open(str(repository.path)).info()
    damaged = [chunk for chunk in (repository.folder / "chunks").iterdir() if chunk.stat().st_size > 4000]
    assert len(damaged) == 4
    for chunk in damaged:
        chunk.write_bytes(bytes(chunk.stat().st_size))
    assert GraspDataset.open(str(repository.path)).info() == expected
