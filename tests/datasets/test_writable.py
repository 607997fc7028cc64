"""Whether something can be made at a place is what the disk says, to root too."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.support.small_disk import files_of_at_most

from handsight.datasets import GraspRepository
from handsight.datasets.address import S3Prefix
from handsight.datasets.errors import StorageError
from handsight.datasets.writable import dataset_fault, file_fault, folder_fault, refuse_unwritable

FAULTS = [file_fault, folder_fault, dataset_fault]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_good_place_has_no_fault_and_stays_as_it_is(fault: Callable[[Path], str | None], tmp_path: Path) -> None:
    before = tmp_path.stat()
    assert fault(tmp_path / "new") is None
    assert list(tmp_path.iterdir()) == []
    assert tmp_path.stat().st_mtime_ns == before.st_mtime_ns


@pytest.mark.parametrize("fault", FAULTS)
def test_what_takes_no_files_is_named(fault: Callable[[Path], str | None], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert fault(Path("/proc/new")) == "/proc takes no new files"
    assert fault(tmp_path / "file" / "new") == f"{tmp_path}/file is a file, expected a folder"
    with files_of_at_most(0):
        assert fault(tmp_path / "new") == f"{tmp_path} takes no new files: File too large"


@pytest.mark.parametrize("fault", FAULTS)
def test_a_link_to_nowhere_is_named_wherever_it_is(fault: Callable[[Path], str | None], tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("unplugged")
    (tmp_path / "round").symlink_to("round")
    for name in ("link", "link/new"):
        assert fault(tmp_path / name) == f"{tmp_path}/link is a link to unplugged, which is not there"
    assert fault(tmp_path / "round") == f"{tmp_path}/round is a link to round, which is not there"


def test_a_file_needs_its_folder_and_a_folder_does_not(tmp_path: Path) -> None:
    said = f"there is no folder {tmp_path}/a/b to write c.png to: create it first"
    assert file_fault(tmp_path / "a" / "b" / "c.png") == said
    assert folder_fault(tmp_path / "a" / "b" / "c") is None


def test_a_file_replaces_no_folder_and_no_device(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "old.png").write_text("old")
    assert file_fault(tmp_path) == f"{tmp_path} is a folder, expected the name of a file"
    for path in (tmp_path / "pipe", Path("/dev/null")):
        assert file_fault(path) == f"{path} is neither a file nor a folder, and would be replaced by one"
    assert file_fault(tmp_path / "old.png") is None
    assert (tmp_path / "old.png").read_text() == "old"


def test_folders_of_a_dataset_are_asked_one_by_one(tmp_path: Path) -> None:
    repository = GraspRepository.create(tmp_path / "grasps")
    assert dataset_fault(repository.folder) is None
    (repository.folder / ".handsight").write_text("in the way")
    assert dataset_fault(repository.folder) == f"{repository.folder}/.handsight is a file, expected a folder"
    with pytest.raises(StorageError, match=r"cannot write to .*: .*\.handsight is a file, expected a folder; mend"):
        repository.release("v1")


def test_a_bucket_is_not_asked() -> None:
    refuse_unwritable(S3Prefix(bucket="lab", prefix="grasps"))
