"""Branches: names for versions that move with each commit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import RefNameError, RefNotFoundError
from handsight.datasets.store.icechunk_engine import icechunk_errors, sync_file_system
from handsight.datasets.store.refs import create_ref
from handsight.datasets.store.releases import DRAFT_PREFIX, check_ref_name, enter_branch
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.store.writers import at_work


def create_branch(repository: GraspRepository, name: str, ref: str = DEFAULT_REF) -> str:
    """Begin a branch at a version, and return the snapshot id.

    Raises:
        RefNameError: The name is malformed, or taken by a release or branch.
        RefNotFoundError: There is no such ref.
    """
    with repository.locked():
        check_new_branch(repository, name)
        snapshot_id = repository.resolve(ref)
        _publish(repository, name, snapshot_id)
    return snapshot_id


def check_new_branch(repository: GraspRepository, name: str) -> None:
    """Refuse a name under which no branch can begin.

    Raises:
        RefNameError: The name is malformed, or taken by a release or branch.
    """
    check_ref_name("branch", name)
    if repository.is_taken(name):
        raise RefNameError(f"{name!r} is taken in {repository.path}: choose another name for the branch")


@contextmanager
def new_branch(repository: GraspRepository, name: str, ref: str, *, what: str) -> Iterator[str]:
    """A branch that gets its name once the block has done its work on it, so that what has a name is finished.

    Until then it is a draft, whose name the block is given: no command shows it, and when the block fails, or its
    process is killed, it goes. The block is registered as a writer.

    Args:
        repository: The dataset.
        name: Of the branch to be.
        ref: The version where it begins.
        what: What the block does, for people.

    Raises:
        RefNameError: The name is malformed, or taken by a release or branch, now or once the work is done.
        RefNotFoundError: There is no such ref.
    """
    check_new_branch(repository, name)
    began = repository.resolve(ref)
    with at_work(repository, what) as writer:
        draft = f"{DRAFT_PREFIX}{writer}"
        try:
            with repository.locked():
                _create(repository, draft, began)
            yield draft
            with repository.locked():
                check_new_branch(repository, name)
                _publish(repository, name, repository.tip(draft))
        finally:
            with repository.locked():
                _delete(repository, draft)


def delete_branch(repository: GraspRepository, name: str, *, force: bool = False) -> str:
    """Drop a branch and return the snapshot id it had, from which it can be created again until the next ``gc``.

    Raises:
        RefNotFoundError: There is no such branch.
        RefNameError: It is the default branch or, without ``force``, holds commits that no other ref leads to.
    """
    with repository.locked():
        snapshot_id = check_deletable(repository, name, force=force)
        repository.change_ledger(f"delete branch {name}", lambda root: enter_branch(root, name, None))
        _delete(repository, name)
    return snapshot_id


def check_deletable(repository: GraspRepository, name: str, *, force: bool = False) -> str:
    """The snapshot id of a branch that can be deleted.

    Raises:
        RefNotFoundError, RefNameError: As for :func:`delete_branch`.
    """
    branches = repository.branches()
    if name not in branches:
        raise RefNotFoundError(f"{repository.path} has no branch {name!r} (branches: {', '.join(branches)})")
    if name == DEFAULT_REF:
        raise RefNameError(f"{name!r} is the default branch of {repository.path} and cannot be deleted")
    if not force and not _is_reachable(repository, branches, name):
        raise RefNameError(
            f"branch {name!r} of {repository.path} holds commits that no other branch or release leads to: "
            f"release it first, or delete it by force"
        )
    return branches[name]


def _publish(repository: GraspRepository, name: str, snapshot_id: str) -> None:
    _create(repository, name, snapshot_id)
    repository.change_ledger(f"branch {name}", lambda root: enter_branch(root, name, snapshot_id))


def _create(repository: GraspRepository, name: str, snapshot_id: str) -> None:
    with icechunk_errors(f"cannot create branch {name!r} of {repository.path}"):
        create_ref(repository.icechunk_repository, repository.path, "branch", name, snapshot_id)


def _delete(repository: GraspRepository, name: str) -> None:
    with icechunk_errors(f"cannot delete branch {name!r} of {repository.path}"):
        if name in repository.icechunk_repository.list_branches():
            repository.icechunk_repository.delete_branch(name)
    if isinstance(repository.path, Path):
        with suppress(OSError):
            (repository.path / "refs" / f"branch.{name}").rmdir()  # Icechunk leaves the folder.
    sync_file_system(repository.path)


def _is_reachable(repository: GraspRepository, branches: dict[str, str], name: str) -> bool:
    """Whether the tip of a branch is in the history of another branch or of a release."""
    others = [tip for branch, tip in branches.items() if branch != name]
    others += [release.snapshot_id for release in repository.releases().values()]
    histories = repository.logs(dict.fromkeys(others))
    return any(entry.snapshot_id == branches[name] for entries in histories for entry in entries)
