"""Creation, opening, refs and history, on disk."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import icechunk
import pytest
import zarr
from filelock import FileLock
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import (
    DatasetBusyError,
    DatasetExistsError,
    DatasetNotFoundError,
    GraspDataset,
    GraspRepository,
    NotADatasetError,
    RefNotFoundError,
    SchemaError,
    SessionWriter,
    StorageError,
    create_branch,
    delete_branch,
)
from handsight.datasets.format.schema import SCHEMA_VERSION
from handsight.datasets.store import icechunk_engine


def test_a_new_dataset_is_empty_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    repository = GraspRepository.create(tmp_path / "deep" / "grasps")
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["grasps"]
    assert repository.branches().keys() == {"main"}
    assert repository.releases() == {}
    info = GraspDataset.open(str(repository.path)).info()
    assert (info.attempts, info.sessions, info.ref, info.schema_version) == (0, 0, "main", SCHEMA_VERSION)


def test_create_takes_an_empty_folder_and_refuses_any_other(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    GraspRepository.create(tmp_path / "empty")
    with pytest.raises(DatasetExistsError, match="already"):
        GraspRepository.create(tmp_path / "empty")
    (tmp_path / "file").write_text("x")
    with pytest.raises(NotADatasetError, match="is a file"):
        GraspRepository.create(tmp_path / "file")
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.png").write_bytes(b"x")
    with pytest.raises(NotADatasetError, match="other files"):
        GraspRepository.create(tmp_path / "photos")
    assert [path.name for path in (tmp_path / "photos").iterdir()] == ["cat.png"]


def test_open_says_what_is_there_instead(tmp_path: Path) -> None:
    with pytest.raises(DatasetNotFoundError, match="dataset init"):
        GraspRepository.open(tmp_path / "nowhere")
    assert not (tmp_path / "nowhere").exists()
    (tmp_path / "file").write_text("x")
    with pytest.raises(NotADatasetError, match="a file"):
        GraspRepository.open(tmp_path / "file")
    with pytest.raises(NotADatasetError, match="no dataset"):
        GraspRepository.open(tmp_path)


@pytest.mark.parametrize("rooted", [False, True])
def test_a_foreign_icechunk_store_is_no_dataset(tmp_path: Path, rooted: bool) -> None:
    store = icechunk.Repository.create(icechunk_engine.storage_at(tmp_path / "other"))
    if rooted:
        transaction = store.writable_session("main")
        zarr.create_group(transaction.store)
        transaction.commit("somebody else's")
    with pytest.raises(NotADatasetError):
        GraspRepository.open(tmp_path / "other")


def test_a_newer_schema_is_refused(repository: GraspRepository) -> None:
    transaction = repository.writable("main")
    zarr.open_group(transaction.store, mode="r+").update_attributes({"schema_version": SCHEMA_VERSION + 1})
    repository.commit(transaction, branch="main", message="from the future")
    newer = f"schema version {SCHEMA_VERSION + 1}, this handsight reads up to {SCHEMA_VERSION}"
    with pytest.raises(SchemaError, match=newer):
        GraspRepository.open(repository.path)


def test_open_or_create(tmp_path: Path) -> None:
    first = GraspRepository.open_or_create(tmp_path / "grasps")
    again = GraspRepository.open_or_create(tmp_path / "grasps")
    assert again.resolve("main") == first.resolve("main")


def test_resolve_prefers_releases_to_branches_to_snapshots(repository: GraspRepository) -> None:
    empty = repository.resolve("main")
    header = make_header()
    record(repository, header, [make_attempt(header, 0)])
    tip = repository.resolve("main")
    assert tip != empty
    assert repository.resolve(empty) == empty
    store = icechunk.Repository.open(icechunk_engine.storage_at(repository.folder))
    store.create_tag("main", empty)
    assert repository.resolve("main") == empty


class Spy:
    """An Icechunk repository that counts what it is asked."""

    def __init__(self, asked: icechunk.Repository) -> None:
        self.asked = asked
        self.calls: Counter[str] = Counter()

    def __getattr__(self, name: str) -> Any:
        method = getattr(self.asked, name)

        def counted(*arguments: Any, **named: Any) -> Any:
            self.calls[name] += 1
            return method(*arguments, **named)

        return counted


@pytest.fixture
def spied(repository: GraspRepository, monkeypatch: pytest.MonkeyPatch) -> tuple[GraspRepository, Spy]:
    """A dataset with 20 releases and 6 branches."""
    for number in range(20):
        repository.release(f"v{number}")
    for number in range(5):
        create_branch(repository, f"b{number}", "v3")
    spy = Spy(repository.icechunk_repository)
    monkeypatch.setattr(repository, "_icechunk", spy)
    return repository, spy


@pytest.mark.parametrize("ref", ["v7", "main", "b4", "snapshot"])
def test_looking_up_a_ref_asks_for_that_one(spied: tuple[GraspRepository, Spy], ref: str) -> None:
    repository, spy = spied
    tip = repository.resolve("main")
    spy.calls.clear()
    assert repository.resolve(tip if ref == "snapshot" else ref) == tip
    assert spy.calls.total() <= 3
    assert set(spy.calls) <= {"readonly_session"}


def test_each_ref_is_looked_up_once_for_the_log_or_for_several(spied: tuple[GraspRepository, Spy]) -> None:
    repository, spy = spied
    spy.calls.clear()
    assert len(repository.log()[0].refs) == 26
    assert spy.calls["lookup_tag"] + spy.calls["lookup_branch"] <= 2 + 26
    spy.calls.clear()
    delete_branch(repository, "b2")
    assert spy.calls["lookup_tag"] + spy.calls["lookup_branch"] <= 3 * 26
    assert spy.calls["delete_branch"] == 1


def test_a_ref_that_cannot_be_read_is_not_taken_for_one_that_is_missing(
    spied: tuple[GraspRepository, Spy], monkeypatch: pytest.MonkeyPatch
) -> None:
    repository, spy = spied

    def unreachable(branch: str | None = None, *, tag: str | None = None) -> icechunk.Session:
        if tag is not None:
            raise icechunk.IcechunkError("object store error")
        return spy.asked.readonly_session(branch)

    monkeypatch.setattr(spy, "readonly_session", unreachable, raising=False)
    with pytest.raises(StorageError, match=r"cannot look up 'v7' in .*: object store error"):
        repository.resolve("v7")
    assert repository.resolve("main") == repository.branches()["main"]


@pytest.mark.parametrize("ref", ["v9", "0" * 20, "", "handsight.releases", "a/b", "x" * 300])
def test_an_unknown_ref_lists_the_known(repository: GraspRepository, ref: str) -> None:
    repository.release("v1")
    with pytest.raises(RefNotFoundError, match="releases: v1; branches: main"):
        repository.resolve(ref)


def test_log_tells_the_history_of_a_ref(repository: GraspRepository) -> None:
    header = make_header()
    writer = SessionWriter.begin(repository, header)
    for number in range(3):
        writer.append(make_attempt(header, number))
    writer.commit("three")
    repository.release("v1")
    writer.append(make_attempt(header, 3))
    writer.seal()
    newest, three, created = repository.log()
    assert [entry.attempts_added for entry in (newest, three, created)] == [1, 3, 0]
    assert [entry.refs for entry in (newest, three, created)] == [("main",), ("v1",), ()]
    assert three.message == "three"
    assert writer.session in newest.message
    assert newest.written_at > three.written_at > created.written_at
    assert [entry.snapshot_id for entry in repository.log("v1")] == [three.snapshot_id, created.snapshot_id]


def test_a_commit_waits_for_the_lock_and_says_who_holds_it(repository: GraspRepository) -> None:
    header = make_header()
    writer = SessionWriter.begin(repository, header)
    writer.append(make_attempt(header, 0))
    assert repository._lock is not None
    repository._lock.timeout = 0.01
    with (
        FileLock(repository.folder / ".handsight" / "commit.lock"),
        pytest.raises(DatasetBusyError, match=r"commit\.lock"),
    ):
        writer.commit()
    assert repository.log()[0].attempts_added == 0
    writer.commit()
    assert repository.log()[0].attempts_added == 1


def test_reading_writes_nothing(repository: GraspRepository) -> None:
    header = make_header()
    record(repository, header, [make_attempt(header, 0)])
    before = {path: path.stat().st_mtime_ns for path in repository.folder.rglob("*")}
    dataset = GraspDataset.open(str(repository.path))
    dataset.info()
    dataset.attempt(dataset.attempts.index[0])
    assert {path: path.stat().st_mtime_ns for path in repository.folder.rglob("*")} == before
