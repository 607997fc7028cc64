"""Going back brings everything back, and loses no history."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import zarr
from tests.support.factories import difference, make_attempt, make_header, record
from tests.support.refusals import check_refused
from tests.support.versions import HEADER, grow, opened

from handsight.cli.app import run
from handsight.datasets import (
    CorruptDataError,
    Curator,
    GraspDataset,
    GraspRepository,
    Outcome,
    RefNotFoundError,
    Selection,
    SessionConflictError,
    SessionWriter,
    create_branch,
    diff_versions,
    revert,
)
from handsight.datasets.curation.saved_filters import save_filter
from handsight.datasets.format.saved_filters import read_filters


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


def poison(repository: GraspRepository) -> str:
    """Give the station a name of null, past all checks; returns the snapshot from before."""
    before = repository.resolve("main")
    transaction = repository.writable("main")
    root = zarr.open_group(transaction.store, mode="r+")
    session = next(group for _, group in root["sessions"].groups())  # type: ignore[union-attr]
    header: Any = session.attrs.asdict()["header"]
    header["station"]["objects"][3] = None
    session.update_attributes({"header": header})
    repository.commit(transaction, branch="main", message="poison")
    return before


def test_a_branch_whose_sessions_cannot_be_read_can_be_reverted(
    repository: GraspRepository, capsys: pytest.CaptureFixture[str]
) -> None:
    grow(repository, 3)
    before = poison(repository)
    with pytest.raises(
        CorruptDataError, match=r"session 01\w+ cannot be read: header.station.objects\[3\] is null, exp"
    ):
        opened(repository)
    for words in ("info", "ls", "doctor", "verify", "stats", "exclude 1 -m x"):
        verb, *rest = words.split()
        check_refused(capsys, ["dataset", verb, str(repository.path), *rest], "objects[3] is null, expected text")
    assert run(["dataset", "revert", str(repository.path), before]) == 0
    assert "what changes is not known: session" in capsys.readouterr().out
    assert_same_version(opened(repository), opened(repository, before))


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
