"""As test_garbage.py, in a bucket, where writers and whoever deletes may be on different machines."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from subprocess import PIPE, Popen

import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.garbage import AHEAD, delete_unawares, delete_what_is_old, waiting_import
from tests.support.s3_server import empty_bucket, s3_server
from typer.testing import CliRunner

from handsight.cli.app import app, run
from handsight.datasets import (
    GraspDataset,
    GraspRepository,
    Outcome,
    SessionWriter,
    StorageError,
    UnknownNameError,
    collect_garbage,
    expire,
    export_dataset,
    import_dataset,
    verify,
)
from handsight.datasets.exchange.merge import merge
from handsight.datasets.store.refs import ref_names

SIZE = 40
HEADER = make_header(width=64, height=48)
"""Large enough that pictures are chunks of their own."""
OTHER = make_header(seed=2, width=64, height=48)
ADDRESS = "s3://lab/week/grasps"

runner = CliRunner()


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """Address of a server that runs until the end of the file."""
    with s3_server() as address:
        yield address


@pytest.fixture
def target(server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> GraspRepository:
    """A dataset in a bucket that holds another session."""
    empty_bucket(server, monkeypatch)
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    repository = GraspRepository.create(ADDRESS)
    record(repository, OTHER, [make_attempt(OTHER, 0)])
    return repository


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], object]:
    """From when it is called, this process is on another machine: it sees none of the files of this one."""
    return lambda: monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "other-machine"))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    """Something to transfer."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("recorded") / "grasps")
    record(repository, HEADER, [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(SIZE)], every=20)
    return GraspDataset(repository, ref="main")


@pytest.fixture(scope="module")
def exported(recorded: GraspDataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as a file."""
    path = tmp_path_factory.mktemp("exported") / "out.hdf5"
    export_dataset(recorded, path, format="hdf5")
    return path


@pytest.mark.parametrize("how", ["merge", "import"])
@pytest.mark.parametrize("where", ["here", "elsewhere"])
def test_a_transfer_outlasts_any_collection(
    recorded: GraspDataset,
    exported: Path,
    target: GraspRepository,
    elsewhere: Callable[[], object],
    how: str,
    where: str,
) -> None:
    deleted: list[int] = []

    def delete_once() -> None:
        if not deleted:
            if where == "elsewhere":
                elsewhere()
            deleted.append(delete_what_is_old(ADDRESS))

    if how == "merge":
        merge(recorded, target, on_attempt=delete_once)
    else:
        import_dataset(exported, ADDRESS, on_attempt=delete_once)
    report = verify(GraspDataset.open(ADDRESS))
    assert (report.ok, report.checked) == (True, SIZE + 1)
    assert delete_what_is_old(ADDRESS) == 0, "everything that was written is in the dataset"
    assert writers_of(target) == []


def writers_of(repository: GraspRepository) -> list[str]:
    """The branches that stand for writers."""
    return [name for name in ref_names(repository.path)[1] if name.startswith("handsight.writer.")]


@pytest.fixture
def killed(exported: Path, target: GraspRepository) -> int:
    """Process id of an import that was killed half way."""
    with Popen(waiting_import(exported, ADDRESS), stdin=PIPE, stdout=PIPE, text=True) as importer:
        assert importer.stdout is not None
        assert importer.stdout.readline() == "half way\n"
        report = collect_garbage(target, datetime.now(UTC) + AHEAD, dry_run=True, grace=-AHEAD)
        assert [(one.pid, one.what) for one in report.writers] == [(importer.pid, "import out.hdf5 (hdf5)")]
        importer.kill()
    return importer.pid


def test_the_machine_of_a_killed_writer_knows_that_it_is_gone(target: GraspRepository, killed: int) -> None:
    assert len(writers_of(target)) == 1
    assert delete_what_is_old(ADDRESS) >= 16
    assert writers_of(target) == []
    assert verify(GraspDataset.open(ADDRESS)).ok


def test_elsewhere_a_killed_writer_is_named_and_can_be_ignored(
    target: GraspRepository, killed: int, elsewhere: Callable[[], object]
) -> None:
    elsewhere()
    assert delete_what_is_old(ADDRESS) == 0
    for ask in (collect_garbage, expire):
        report = ask(GraspRepository.open(ADDRESS), datetime.now(UTC), dry_run=True)
        (writer,) = report.writers
        assert (writer.pid, writer.what, writer.session) == (killed, "write", None)
    with pytest.raises(UnknownNameError, match=f"no writer NOBODY that can be ignored .writers: {writer.id}."):
        collect_garbage(GraspRepository.open(ADDRESS), dry_run=False, ignored_writers=["NOBODY"])

    told = runner.invoke(app, ["dataset", "expire", ADDRESS, "--older-than", "0s", "--dry-run"])
    assert told.exit_code == 0
    assert f"if it is gone, add --ignore-writer {writer.id}" in " ".join(told.output.split())
    ignoring = [ADDRESS, "--ignore-writer", writer.id]
    planned = runner.invoke(app, ["dataset", "expire", *ignoring, "--older-than", "0s", "--dry-run", "--json"])
    assert (planned.exit_code, json.loads(planned.output)["retained_by"]) == (0, [])
    assert len(writers_of(target)) == 1, "a dry run changes nothing"
    done = runner.invoke(app, ["dataset", "gc", *ignoring, "--json"])
    assert (done.exit_code, json.loads(done.output)["retained_by"]) == (0, [])
    assert writers_of(target) == []
    assert delete_what_is_old(ADDRESS) >= 16
    assert verify(GraspDataset.open(ADDRESS)).ok
    assert run(["dataset", "gc", *ignoring]) == 2, "there is no such writer any more"


def test_expiry_keeps_the_version_that_a_writer_elsewhere_began_from(
    target: GraspRepository, elsewhere: Callable[[], object]
) -> None:
    writer = SessionWriter.begin(target, HEADER)
    found = target.tip("main")
    writer.append(make_attempt(HEADER, 0))
    other = SessionWriter.resume(GraspRepository.open(ADDRESS), OTHER)
    other.append(make_attempt(OTHER, other.next_number))
    other.seal()
    elsewhere()
    delete_what_is_old(ADDRESS)
    assert GraspRepository.open(ADDRESS).has_snapshot(found)
    writer.seal()
    assert len(GraspDataset.open(ADDRESS).attempts) == 3
    assert verify(GraspDataset.open(ADDRESS)).ok


def test_a_transfer_whose_version_is_expired_is_made_again_from_the_new_tip(
    recorded: GraspDataset, target: GraspRepository
) -> None:
    """Others commit, and somebody expires and deletes everything that has no name, the transfer's chunks included."""
    other = SessionWriter.resume(GraspRepository.open(ADDRESS), OTHER)
    calls: list[int] = []

    def on_attempt() -> None:
        calls.append(0)
        if len(calls) == SIZE:
            other.append(make_attempt(OTHER, other.next_number))
            other.commit()
            delete_unawares(ADDRESS)

    assert merge(recorded, target, on_attempt=on_attempt).attempts == SIZE
    report = verify(GraspDataset.open(ADDRESS))
    assert (report.ok, report.checked) == (True, SIZE + 2)


def test_a_collection_that_knew_nothing_of_a_transfer_makes_it_fail(
    recorded: GraspDataset, target: GraspRepository
) -> None:
    calls: list[int] = []

    def on_attempt() -> None:
        calls.append(0)
        if len(calls) == SIZE:
            delete_unawares(ADDRESS)

    before = target.tip("main")
    with pytest.raises(StorageError, match="deleted before it could be committed"):
        merge(recorded, target, on_attempt=on_attempt)
    assert target.tip("main") == before
    assert verify(GraspDataset.open(ADDRESS)).ok
    assert writers_of(target) == []


def test_a_recorder_goes_on_beside_endless_expiry_and_collection(target: GraspRepository) -> None:
    other = SessionWriter.resume(GraspRepository.open(ADDRESS), OTHER)
    with SessionWriter.begin(target, HEADER) as writer:
        for number in range(8):
            writer.append(make_attempt(HEADER, number, outcome=Outcome.HELD))
            other.append(make_attempt(OTHER, other.next_number))
            other.commit()
            (delete_unawares if number % 2 else delete_what_is_old)(ADDRESS)
            writer.commit()
    other.close()
    dataset = GraspDataset.open(ADDRESS)
    assert {one.header.seed: one.attempts for one in dataset.sessions} == {1: 8, 2: 9}
    assert verify(dataset).ok
