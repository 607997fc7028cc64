"""A release names the very snapshot, once and for all."""

from __future__ import annotations

import icechunk
import pytest
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository, RefNameError, RefNotFoundError
from handsight.datasets.store import icechunk_engine


def test_a_release_names_the_very_snapshot_and_never_moves(repository: GraspRepository) -> None:
    header = make_header()
    writer = record(repository, header, [make_attempt(header, 0)])
    tip = repository.resolve("main")
    release = repository.release("v1", "main", "first look")
    assert (release.name, release.snapshot_id, release.message) == ("v1", tip, "first look")
    assert repository.resolve("main") == tip
    writer.append(make_attempt(header, 1))
    writer.commit()
    repository.release("v2", "v1", "the same again")
    reopened = GraspRepository.open(repository.path)
    assert reopened.releases() == {"v1": release, "v2": repository.releases()["v2"]}
    assert reopened.resolve("v1") == reopened.resolve("v2") == tip != reopened.resolve("main")
    assert len(GraspDataset.open(f"{repository.path}@v1").attempts) == 1
    assert len(GraspDataset.open(f"{repository.path}").attempts) == 2


@pytest.mark.parametrize(
    "name", ["", "a/b", "v@1", "-v", ".v", "v 1", "x" * 65, "0" * 20, "main", "handsight.releases"]
)
def test_names_a_release_cannot_take(repository: GraspRepository, name: str) -> None:
    with pytest.raises(RefNameError):
        repository.release(name)
    assert repository.releases() == {}


def test_a_release_name_is_used_once_even_when_deleted(repository: GraspRepository) -> None:
    repository.release("v1")
    with pytest.raises(RefNameError, match="taken"):
        repository.release("v1")
    icechunk.Repository.open(icechunk_engine.storage_at(repository.folder)).delete_tag("v1")
    with pytest.raises(RefNameError, match="deleted"):
        repository.release("v1")
    assert repository.releases() == {}


def test_a_release_of_an_unknown_ref_changes_nothing(repository: GraspRepository) -> None:
    with pytest.raises(RefNotFoundError):
        repository.release("v1", "nope")
    assert repository.releases() == {}
    assert repository.release("v1").name == "v1"
