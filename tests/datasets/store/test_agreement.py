"""A name that the disk has lost is missed, keeps what it led to from being deleted, and can be put back."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from tests.support.versions import grow, opened

from handsight.datasets import (
    CorruptDataError,
    GraspRepository,
    RefNameError,
    collect_garbage,
    create_branch,
    delete_branch,
    doctor,
    expire,
    verify,
)
from handsight.datasets.store.agreement import lost_refs
from handsight.datasets.store.refs import create_ref
from handsight.datasets.store.releases import Release, add_to_ledger
from handsight.datasets.store.restoring import restore_refs


def _flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[15] ^= 1  # Within the snapshot's id.
    file.write_bytes(content)


def _fill(file: Path, content: bytes) -> None:
    file.write_bytes(content)


HARM: dict[str, Callable[[Path], None]] = {
    "flipped": lambda folder: _flip(folder / "ref.json"),
    "zeroed": lambda folder: _fill(folder / "ref.json", bytes(30)),
    "emptied": lambda folder: _fill(folder / "ref.json", b""),
    "file gone": lambda folder: (folder / "ref.json").unlink(),
    "folder gone": shutil.rmtree,
}


def lost(repository: GraspRepository) -> list[str]:
    return [one.name for one in lost_refs(GraspRepository.open(repository.path))]


@pytest.mark.parametrize("harm", HARM)
def test_a_lost_release_is_missed_kept_and_put_back(repository: GraspRepository, harm: str) -> None:
    released = grow(repository, 3)
    repository.release("v1")
    grow(repository, 5)
    assert lost(repository) == []
    HARM[harm](repository.folder / "refs" / "tag.v1")

    reopened = GraspRepository.open(repository.path)
    assert lost(repository) == ["v1"]
    assert not verify(opened(reopened)).ok
    assert "GD-108" in {one.code for one in doctor(opened(reopened)).findings}
    with pytest.raises(CorruptDataError, match=r"collecting garbage is refused: release 'v1'.*dataset repair"):
        collect_garbage(reopened, dry_run=False, grace=timedelta(0))
    with pytest.raises(CorruptDataError, match="expiring commits is refused"):
        expire(reopened, datetime.now(UTC), dry_run=True)

    assert [one.name for one in restore_refs(reopened)] == ["v1"]
    assert lost(repository) == []
    assert GraspRepository.open(repository.path).resolve("v1") == released


@pytest.mark.parametrize("harm", ["file gone", "folder gone"])
def test_the_name_of_a_lost_release_is_not_given_again(repository: GraspRepository, harm: str) -> None:
    released = grow(repository, 3)
    repository.release("v1")
    grow(repository, 5)
    HARM[harm](repository.folder / "refs" / "tag.v1")
    with pytest.raises(RefNameError, match="is lost: choose another name"):
        GraspRepository.open(repository.path).release("v1")
    restore_refs(GraspRepository.open(repository.path))
    assert GraspRepository.open(repository.path).resolve("v1") == released


def test_a_lost_branch_is_missed(repository: GraspRepository) -> None:
    grow(repository, 3)
    create_branch(repository, "dev")
    create_branch(repository, "old")
    delete_branch(repository, "old")
    assert lost(repository) == []
    shutil.rmtree(repository.folder / "refs" / "branch.dev")
    assert lost(repository) == ["dev"]
    with pytest.raises(CorruptDataError, match=r"branch 'dev'.*is gone"):
        collect_garbage(GraspRepository.open(repository.path), dry_run=False)


def test_a_release_that_was_not_finished_is_none(repository: GraspRepository) -> None:
    tip = grow(repository, 3)
    release = Release(name="v1", snapshot_id=tip, message="", released_at=None)
    repository.change_ledger("release v1", lambda root: add_to_ledger(root, release, pending=True))
    assert lost(repository) == []
    assert repository.release("v1").snapshot_id == tip
    assert lost(repository) == []


def test_a_release_that_was_deleted_on_purpose_is_not_lost(repository: GraspRepository) -> None:
    grow(repository, 3)
    repository.release("v1")
    repository.icechunk_repository.delete_tag("v1")
    assert lost(repository) == []


def test_a_tag_that_icechunk_made_is_no_fault(repository: GraspRepository) -> None:
    tip = grow(repository, 3)
    create_ref(repository.icechunk_repository, repository.path, "tag", "other", tip)
    assert lost(repository) == []
