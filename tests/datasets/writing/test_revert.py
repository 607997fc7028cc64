"""Branches, going back, and what changed between two versions."""

from __future__ import annotations

from pathlib import Path

import pytest
import zarr
from tests.support.factories import difference, make_attempt, make_header, record

from handsight.datasets import (
    Curator,
    GraspDataset,
    GraspRepository,
    Outcome,
    RefNameError,
    RefNotFoundError,
    Selection,
    SessionConflictError,
    SessionWriter,
    create_branch,
    delete_branch,
    diff_versions,
    revert,
)
from handsight.datasets.curation.saved_filters import save_filter
from handsight.datasets.format.saved_filters import read_filters

HEADER = make_header()


def opened(repository: GraspRepository, ref: str = "main") -> GraspDataset:
    return GraspDataset.open(f"{repository.path}@{ref}")


def numbers(ids: tuple[str, ...]) -> list[int]:
    return [int(identity.rpartition("-")[2]) for identity in ids]


def grow(repository: GraspRepository, to: int, branch: str = "main") -> str:
    """Go on with the session until it has that many attempts, held and empty by turns."""
    held = bool(opened(repository, branch).sessions)
    with (SessionWriter.resume if held else SessionWriter.begin)(repository, HEADER, branch) as writer:
        while writer.next_number < to:
            outcome = Outcome.EMPTY if writer.next_number % 2 else Outcome.HELD
            writer.append(make_attempt(HEADER, writer.next_number, outcome=outcome))
    return repository.resolve(branch)


def assert_same_version(left: GraspDataset, right: GraspDataset) -> None:
    assert left.attempts.equals(right.attempts)
    assert left.sessions == right.sessions
    assert left.overlay.decisions == right.overlay.decisions
    for identity in left.attempts.index:
        assert difference(left.attempt(identity), right.attempt(identity)) is None
    roots = [dataset.repository.root(dataset.snapshot_id) for dataset in (left, right)]
    metadata = [{path: repr(node.metadata) for path, node in root.members(max_depth=None)} for root in roots]
    assert metadata[0] == metadata[1]
    assert read_filters(roots[0]) == read_filters(roots[1])
    assert diff_versions(left, right).empty


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


def test_revert_brings_everything_back_and_loses_no_history(repository: GraspRepository) -> None:
    grow(repository, 3)
    save_filter(repository, "cups", "target == 'cup'", author="anna")
    Curator(repository, author="anna").exclude(Selection(where="number == 1"), "x")
    early = repository.resolve("main")
    grow(repository, 7)
    other = make_header(seed=9)
    record(repository, other, [make_attempt(other, number) for number in range(2)])
    Curator(repository, author="ben").relabel(Selection(where="success and seed == 1"), False, "y")
    save_filter(repository, "held", "success", author="ben")
    late = repository.resolve("main")
    back = revert(repository, early)
    assert back == repository.resolve("main")
    assert_same_version(opened(repository), opened(repository, early))
    forth = revert(repository, late, message="sorry")
    assert_same_version(opened(repository), opened(repository, late))
    assert [entry.snapshot_id for entry in repository.log()[:3]] == [forth, back, late]
    assert [entry.message for entry in repository.log()[:2]] == ["sorry", f"revert to {early} ({early})"]


def test_revert_to_what_is_there_already_does_nothing(repository: GraspRepository) -> None:
    tip = grow(repository, 2)
    repository.release("v1")
    assert revert(repository, "v1") is None
    assert repository.resolve("main") == tip
    with pytest.raises(RefNotFoundError):
        revert(repository, "nowhere")
    with pytest.raises(RefNotFoundError):
        revert(repository, "v1", branch="dev")


def test_revert_to_another_branch_takes_its_rows(repository: GraspRepository) -> None:
    """Both branches went on with the same session, apart from each other."""
    grow(repository, 2)
    create_branch(repository, "dev")
    grow(repository, 300)
    with SessionWriter.resume(repository, HEADER, "dev") as writer:
        for number in range(2, 5):
            writer.append(make_attempt(HEADER, number, outcome=Outcome.UNREACHABLE))
    revert(repository, "dev")
    assert_same_version(opened(repository), opened(repository, "dev"))
    grow(repository, 301)
    assert opened(repository).attempts["outcome"].tolist()[:6] == ["held", "empty", *["unreachable"] * 3, "empty"]


def test_a_writer_that_was_reverted_under_is_refused(repository: GraspRepository) -> None:
    early = grow(repository, 2)
    grow(repository, 4)
    writer = SessionWriter.resume(repository, HEADER)
    writer.append(make_attempt(HEADER, 4))
    revert(repository, early)
    with pytest.raises(SessionConflictError, match="has 2 attempts, this writer knows of 4"):
        writer.commit()
    assert grow(repository, 3) == repository.resolve("main")


def test_diff_names_what_was_added_removed_and_replaced(repository: GraspRepository) -> None:
    grow(repository, 3)
    create_branch(repository, "dev")
    grow(repository, 5)
    with SessionWriter.resume(repository, HEADER, "dev") as writer:
        writer.append(make_attempt(HEADER, 3, outcome=Outcome.UNREACHABLE))
    diff = diff_versions(opened(repository, "dev"), opened(repository))
    assert (numbers(diff.added), numbers(diff.removed), numbers(diff.replaced)) == ([4], [], [3])
    back = diff_versions(opened(repository), opened(repository, "dev"))
    assert (numbers(back.added), numbers(back.removed), numbers(back.replaced)) == ([], [4], [3])
    assert (back.before, back.after) == (diff.after, diff.before)


def test_diff_names_what_curation_did_and_how_the_balance_moved(repository: GraspRepository) -> None:
    anna = Curator(repository, author="anna")
    grow(repository, 6)
    anna.exclude(Selection(where="number == 5"), "x")
    before = opened(repository)
    anna.restore(Selection(where="number == 5"), "y")
    anna.exclude(Selection(where="number in [0, 1]"), "z")
    anna.relabel(Selection(where="number == 2"), False, "z")
    grow(repository, 8)
    anna.relabel(Selection(where="number == 7"), True, "z")
    anna.exclude(Selection(where="number == 6"), "z")
    after = opened(repository)
    diff = diff_versions(before, after)
    assert numbers(diff.added) == [6, 7]
    assert (numbers(diff.excluded), numbers(diff.restored), numbers(diff.relabelled)) == ([0, 1, 6], [5], [2, 7])
    assert (diff.balance_before.attempts, diff.balance_before.successes) == (5, 3)
    assert (diff.balance_after.attempts, diff.balance_after.labelled, diff.balance_after.successes) == (5, 5, 2)
    for name, (was, now) in diff.objects.items():
        for balance, table in ((was, before.attempts), (now, after.attempts)):
            rows = table[(table["target"] == name) & ~table["excluded"]]
            assert (balance.attempts, balance.successes) == (len(rows), int(rows["success"].sum()))
        assert was != now


def test_diff_with_an_empty_version(repository: GraspRepository) -> None:
    empty = opened(repository)
    grow(repository, 2)
    assert numbers(diff_versions(empty, opened(repository)).added) == [0, 1]
    assert numbers(diff_versions(opened(repository), empty).removed) == [0, 1]
    assert diff_versions(empty, empty).empty


def test_revert_refuses_to_copy_damage(repository: GraspRepository, tmp_path: Path) -> None:
    before = {path.name for path in (repository.folder / "chunks").iterdir()} if _has_chunks(repository) else set()
    header = make_header(width=64, height=48)
    record(repository, header, [make_attempt(header, 0, outcome=Outcome.HELD)])
    damaged = [path for path in (repository.folder / "chunks").iterdir() if path.name not in before]
    tip = repository.resolve("main")
    revert(repository, repository.log()[-1].snapshot_id)
    empty = repository.resolve("main")
    largest = max(damaged, key=lambda path: path.stat().st_size)
    largest.write_bytes(bytes(largest.stat().st_size))
    with pytest.raises(OSError, match="cannot be copied"):
        revert(repository, tip)
    assert repository.resolve("main") == empty
    assert isinstance(repository.root(empty), zarr.Group)


def _has_chunks(repository: GraspRepository) -> bool:
    return (repository.folder / "chunks").is_dir()
