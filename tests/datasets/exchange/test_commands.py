"""What goes out in another format comes back whole, and what is not sound never gets in."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.factories import difference, make_attempt, make_header, record
from tests.support.small_disk import files_of_at_most

from handsight.datasets import (
    EXPORT_FORMATS,
    GraspDataset,
    GraspRepository,
    InterchangeError,
    MergeError,
    Outcome,
    StorageError,
    export_dataset,
    import_dataset,
)


def snapshot_of_folder(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_a_round_trip_keeps_every_byte(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    seen = []
    export_dataset(dataset, tmp_path / "out", format=name, on_attempt=lambda: seen.append(1))
    report = import_dataset(tmp_path / "out", tmp_path / "back")
    assert (report.format, report.created, report.transfer.attempts, len(seen)) == (name, True, 24, 24)
    back = GraspDataset.open(f"{tmp_path}/back")
    assert back.digest == dataset.digest
    assert back.curation_digest == dataset.curation_digest
    assert back.sessions == dataset.sessions
    assert back.overlay.decisions == dataset.overlay.decisions
    assert back.attempts.equals(dataset.attempts)
    for identity in dataset.attempts.index:
        assert difference(back.attempt(identity), dataset.attempt(identity)) is None
    assert sorted(path.name for path in tmp_path.iterdir()) == ["back", "grasps", "out"]


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_an_empty_dataset_makes_the_round_trip(repository: GraspRepository, tmp_path: Path, name: str) -> None:
    export_dataset(GraspDataset(repository, ref="main"), tmp_path / "out", format=name)
    assert import_dataset(tmp_path / "out", tmp_path / "back").transfer.attempts == 0
    assert GraspDataset.open(f"{tmp_path}/back").attempts.empty


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_importing_again_adds_nothing(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    export_dataset(dataset, tmp_path / "out", format=name)
    before = dataset.repository.resolve("main")
    report = import_dataset(tmp_path / "out", dataset.repository.path)
    assert not report.created
    assert report.transfer.sessions == ()
    assert report.transfer.duplicates == tuple(session.ulid for session in dataset.sessions)
    assert dataset.repository.resolve("main") == before


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_a_dry_run_changes_nothing(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    export_dataset(dataset, tmp_path / "out", format=name)
    report = import_dataset(tmp_path / "out", tmp_path / "back", dry_run=True)
    assert (report.created, report.transfer.attempts, report.transfer.snapshot) == (False, 24, None)
    assert not (tmp_path / "back").exists()


@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_an_export_never_overwrites_and_a_failed_one_leaves_nothing(
    dataset: GraspDataset, tmp_path: Path, name: str
) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(InterchangeError, match="something at"):
        export_dataset(dataset, tmp_path / "out", format=name)
    assert (tmp_path / "out").read_text() == "mine"

    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_dataset(dataset, tmp_path / "new" / "out", format=name, on_attempt=stop)
    assert list((tmp_path / "new").iterdir()) == []


@pytest.mark.parametrize("size", [100, 3000, 20_000])
@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_a_full_disk_is_a_storage_error_and_leaves_nothing(
    repository: GraspRepository, tmp_path: Path, name: str, size: int
) -> None:
    header = make_header(seed=1, width=160, height=120)
    record(repository, header, [make_attempt(header, number, outcome=Outcome.HELD) for number in range(3)])
    version = GraspDataset(repository, ref="main")
    with files_of_at_most(size), pytest.raises(StorageError, match=r"cannot write .*/out: .*[Ff]ile too large"):
        export_dataset(version, tmp_path / "out", format=name)
    assert [path.name for path in tmp_path.iterdir()] == ["grasps"]


def test_formats_are_named_and_told_apart(dataset: GraspDataset, tmp_path: Path) -> None:
    with pytest.raises(InterchangeError, match="'csv', expected one of hdf5, zarr, lerobot, images"):
        export_dataset(dataset, tmp_path / "out", format="csv")
    with pytest.raises(InterchangeError, match="there is nothing at"):
        import_dataset(tmp_path / "nowhere", tmp_path / "back")
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(InterchangeError, match="in no known format"):
        import_dataset(tmp_path / "notes.txt", tmp_path / "back")
    assert not (tmp_path / "back").exists()


def test_a_session_of_other_instruments_is_refused_unless_allowed(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    other = GraspRepository.create(tmp_path / "other")
    header = make_header(seed=9, depth_scale_m=2e-3, gripper_stroke_m=0.14)
    record(other, header, [make_attempt(header, 0, outcome=Outcome.HELD)])
    with pytest.raises(MergeError, match=r"depth_scale_m 0.001, the dataset 0.002.*gripper_stroke_m 0.085, the"):
        import_dataset(tmp_path / "out", tmp_path / "other")
    assert len(GraspDataset.open(f"{tmp_path}/other").attempts) == 1
    import_dataset(tmp_path / "out", tmp_path / "other", allow_mismatch=True)
    assert len(GraspDataset.open(f"{tmp_path}/other").attempts) == 25
