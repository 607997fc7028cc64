"""Branches move alone, and are deleted only where nothing is lost with them."""

from __future__ import annotations

import sys
from pathlib import Path
from subprocess import PIPE, Popen

import pytest
from tests.support.s3_server import empty_bucket, s3_server
from tests.support.versions import grow, opened

from handsight.datasets import (
    Curator,
    GraspRepository,
    RefNameError,
    RefNotFoundError,
    Selection,
    collect_garbage,
    create_branch,
    delete_branch,
)
from handsight.datasets.store.branches import new_branch


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


DRAFTING = """
import sys
from handsight.datasets import GraspRepository
from handsight.datasets.store.branches import new_branch
with new_branch(GraspRepository.open(sys.argv[1]), "mended", "main", what="try") as draft:
    print(draft, flush=True)
    sys.stdin.read()
"""


def test_a_branch_that_is_killed_before_it_is_done_has_no_name_and_goes(repository: GraspRepository) -> None:
    drafts = repository.folder / "refs"
    with Popen([sys.executable, "-P", "-c", DRAFTING, str(repository.path)], stdin=PIPE, stdout=PIPE, text=True) as one:
        assert one.stdout is not None
        draft = one.stdout.readline().strip()
        assert (drafts / f"branch.{draft}").is_dir()
        # Another command, such as this one, leaves alone what somebody works at.
        create_branch(GraspRepository.open(repository.path), "other")
        assert (drafts / f"branch.{draft}").is_dir()
        assert list(repository.branches()) == ["main", "other"]
        one.kill()
    create_branch(GraspRepository.open(repository.path), "mended")
    assert not list(drafts.glob("*draft*"))
    assert list(repository.branches()) == ["main", "mended", "other"]
    assert not list((repository.side_folder / "writers").iterdir())


def test_a_draft_in_a_bucket_goes_with_its_writer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    with s3_server() as server:
        empty_bucket(server, monkeypatch)
        repository = GraspRepository.create("s3://lab/week/grasps")
        with new_branch(repository, "mended", "main", what="try") as draft:
            collect_garbage(repository, dry_run=False)
            assert draft in repository.icechunk_repository.list_branches()
        assert list(repository.branches()) == ["main", "mended"]
        address = str(repository.path)
        with Popen(
            [sys.executable, "-P", "-c", DRAFTING.replace("mended", "late"), address], stdin=PIPE, stdout=PIPE
        ) as one:
            assert one.stdout is not None
            draft = one.stdout.readline().decode().strip()
            assert draft in repository.icechunk_repository.list_branches()
            one.kill()
        assert list(repository.branches()) == ["main", "mended"]
        collect_garbage(repository, dry_run=False)
        names = repository.icechunk_repository.list_branches()
        assert names == {"main", "mended", "handsight.releases"}
