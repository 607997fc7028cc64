"""The files of a dataset, as a disk lists them; of a bucket see scenarios/test_requests.py."""

from __future__ import annotations

import pytest

from handsight.datasets import GraspRepository, StorageError, create_branch
from handsight.datasets.store.files import stored_files
from handsight.datasets.store.refs import ref_names


def test_every_file_counts_but_those_left_out(repository: GraspRepository) -> None:
    whole = stored_files(repository.folder)
    on_disk = {path: path.stat().st_size for path in repository.folder.rglob("*") if path.is_file()}
    assert whole == {path.relative_to(repository.folder).as_posix(): size for path, size in on_disk.items()}
    (repository.folder / ".handsight" / "inputs").mkdir(parents=True)
    (repository.folder / ".handsight" / "inputs" / "x.npy").write_bytes(b"cache")
    assert stored_files(repository.folder, leave_out=".handsight") == whole
    assert stored_files(repository.folder, ".handsight") == {"inputs/x.npy": 5}
    assert stored_files(repository.folder, "nowhere") == {}


def test_a_folder_that_cannot_be_listed_is_an_error_of_storage(repository: GraspRepository) -> None:
    (repository.folder / "refs").rename(repository.folder / "elsewhere")
    (repository.folder / "refs").write_text("no folder")
    with pytest.raises(StorageError, match=r"cannot list .*refs"):
        ref_names(repository.path)


def test_names_are_those_that_icechunk_lists(repository: GraspRepository) -> None:
    repository.release("v1")
    repository.release("v2")
    create_branch(repository, "dev")
    engine = repository.icechunk_repository
    engine.delete_tag("v1")
    (repository.folder / "refs" / "branch.half").mkdir()  # Made by a process that was killed.
    assert ref_names(repository.path) == (["v2"], ["dev", "handsight.releases", "main"])
    assert engine.list_tags() == {"v2"}
