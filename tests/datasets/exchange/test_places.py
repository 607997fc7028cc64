"""Where exports and imports may read and write."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import (
    EXPORT_FORMATS,
    GraspDataset,
    GraspRepository,
    InterchangeError,
    StorageError,
    export_dataset,
    import_dataset,
)
from handsight.datasets.exchange.merge import merge
from handsight.datasets.exchange.places import staying_in_place


@pytest.mark.parametrize("inside", ["out", "chunks/out", "new/folders/out", "../link/out"])
@pytest.mark.parametrize("name", EXPORT_FORMATS)
def test_nothing_is_exported_into_a_dataset(dataset: GraspDataset, tmp_path: Path, name: str, inside: str) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "grasps")
    before = sorted((tmp_path / "grasps").rglob("*"))
    with pytest.raises(InterchangeError, match=r"is inside the dataset .*/grasps: choose a path outside"):
        export_dataset(dataset, tmp_path / "grasps" / inside, format=name)
    assert sorted((tmp_path / "grasps").rglob("*")) == before


@pytest.mark.parametrize("dry_run", [False, True])
def test_no_dataset_is_made_inside_another(dataset: GraspDataset, tmp_path: Path, dry_run: bool) -> None:
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    with pytest.raises(InterchangeError, match="is inside the dataset"):
        import_dataset(tmp_path / "out", tmp_path / "grasps/new", dry_run=dry_run)
    assert not (tmp_path / "grasps/new").exists()


@pytest.mark.parametrize("format", [None, "hdf5"])
def test_what_is_no_file_says_what_it_is(dataset: GraspDataset, tmp_path: Path, format: str | None) -> None:
    (tmp_path / "link").symlink_to("nowhere")
    (tmp_path / "._out.hdf5").write_bytes(b"\0\5\x16\7")
    with pytest.raises(InterchangeError, match="link is a link to nowhere, which is not there"):
        import_dataset(tmp_path / "link", tmp_path / "new", format=format)
    with pytest.raises(InterchangeError, match=r"what macOS keeps beside a file .* import .*/out.hdf5"):
        import_dataset(tmp_path / "._out.hdf5", tmp_path / "new", format=format)
    with pytest.raises(InterchangeError, match="link is a link to nowhere, which is not there"):
        export_dataset(dataset, tmp_path / "link", format="hdf5")


@pytest.mark.parametrize("at", [1, 24])
def test_a_dataset_that_is_renamed_meanwhile_is_not_damaged(dataset: GraspDataset, tmp_path: Path, at: int) -> None:
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    target = GraspRepository.create(tmp_path / "target")
    tip = target.resolve("main")
    seen: list[int] = []

    def rename() -> None:
        seen.append(1)
        if len(seen) == at:
            (tmp_path / "target").rename(tmp_path / "moved")

    with pytest.raises(StorageError, match="target was moved or renamed while it was written to"):
        import_dataset(tmp_path / "out", tmp_path / "target", on_attempt=rename)
    assert not (tmp_path / "target").exists()
    assert GraspRepository.open(tmp_path / "moved").resolve("main") == tip
    import_dataset(tmp_path / "out", tmp_path / "moved")


def test_so_does_a_merge_say(dataset: GraspDataset, tmp_path: Path) -> None:
    target = GraspRepository.create(tmp_path / "target")
    header = make_header(seed=7)
    record(target, header, [make_attempt(header, 0)])

    def rename() -> None:
        if (tmp_path / "target").exists() and not (tmp_path / "moved").exists():
            (tmp_path / "target").rename(tmp_path / "moved")

    with pytest.raises(StorageError, match="target was moved or renamed"):
        merge(dataset, target, on_attempt=rename)


def test_what_others_put_in_its_place_stays(tmp_path: Path) -> None:
    (tmp_path / "grasps").mkdir()

    def replace() -> None:
        with staying_in_place(tmp_path / "grasps"):
            (tmp_path / "grasps").rename(tmp_path / "moved")
            (tmp_path / "grasps").mkdir()
            (tmp_path / "grasps/notes.txt").write_text("mine")
            raise StorageError("gone")

    with pytest.raises(StorageError, match="was moved or renamed"):
        replace()
    assert (tmp_path / "grasps/notes.txt").read_text() == "mine"
