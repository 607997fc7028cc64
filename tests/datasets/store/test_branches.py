"""Branches move alone, and are deleted only where nothing is lost with them."""

from __future__ import annotations

import pytest
from tests.support.versions import grow, opened

from handsight.datasets import (
    Curator,
    GraspRepository,
    RefNameError,
    RefNotFoundError,
    Selection,
    create_branch,
    delete_branch,
)


def test_a_branch_moves_alone(repository: GraspRepository) -> None:
    tip = grow(repository, 3)
    assert create_branch(repository, "dev") == tip
    Curator(repository, author="anna", branch="dev").exclude(Selection(where="success"), "x")
    assert repository.resolve("main") == tip
    assert (opened(repository).info().excluded, opened(repository, "dev").info().excluded) == (0, 2)
    reopened = GraspRepository.open(repository.path)
    assert reopened.branches().keys() == {"dev", "main"}


@pytest.mark.parametrize("name", ["", "a/b", "main", "v1", "0" * 20, "handsight.releases"])
def test_names_a_branch_cannot_take(repository: GraspRepository, name: str) -> None:
    repository.release("v1")
    with pytest.raises(RefNameError):
        create_branch(repository, name)
    with pytest.raises(RefNotFoundError):
        create_branch(repository, "dev", "nowhere")
    assert repository.branches().keys() == {"main"}


def test_a_release_cannot_take_the_name_of_a_branch(repository: GraspRepository) -> None:
    create_branch(repository, "dev")
    with pytest.raises(RefNameError, match="taken"):
        repository.release("dev")


def test_only_a_branch_that_others_lead_to_is_deleted_unless_forced(repository: GraspRepository) -> None:
    start = grow(repository, 2)
    create_branch(repository, "dev")
    assert delete_branch(repository, "dev") == start
    create_branch(repository, "dev")
    tip = grow(repository, 4, "dev")
    with pytest.raises(RefNameError, match="holds commits that no other branch or release leads to"):
        delete_branch(repository, "dev")
    assert delete_branch(repository, "dev", force=True) == tip
    assert repository.branches() == {"main": start}
    create_branch(repository, "dev", tip)
    assert len(opened(repository, "dev").attempts) == 4
    repository.release("v1", "dev")
    delete_branch(repository, "dev")
    assert len(opened(repository, "v1").attempts) == 4


def test_the_default_branch_and_what_does_not_exist_are_not_deleted(repository: GraspRepository) -> None:
    with pytest.raises(RefNameError, match="default branch"):
        delete_branch(repository, "main", force=True)
    for name in ("dev", "handsight.releases"):
        with pytest.raises(RefNotFoundError, match=f"no branch '{name}'"):
            delete_branch(repository, name)
