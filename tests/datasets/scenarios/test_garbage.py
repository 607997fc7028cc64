"""Garbage is collected and commits are expired beside writers that take their time: nothing of theirs is lost.

The clock of whoever deletes is two hours ahead, so that to it nothing is too young.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from subprocess import PIPE, Popen

import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.garbage import AHEAD, delete_unawares, delete_what_is_old, waiting_import
from tests.support.image_table import write_images

from handsight.datasets import (
    GraspDataset,
    GraspRepository,
    Outcome,
    SessionWriter,
    StorageError,
    collect_garbage,
    export_dataset,
    import_dataset,
    verify,
)
from handsight.datasets.exchange.merge import merge

SIZE = 40
HEADER = make_header(width=64, height=48)
"""Large enough that pictures are chunks of their own."""
OTHER = make_header(seed=2, width=64, height=48)
PROGRAM = Path(__file__).parents[2] / "support" / "factories.py"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    """Something to transfer."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("recorded") / "grasps")
    record(repository, HEADER, [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(SIZE)], every=20)
    return GraspDataset(repository, ref="main")


@pytest.fixture
def target(repository: GraspRepository) -> GraspRepository:
    """A dataset that holds another session."""
    record(repository, OTHER, [make_attempt(OTHER, 0)])
    return repository


def transferring(
    how: str, recorded: GraspDataset, folder: Path
) -> Callable[[GraspRepository, Callable[[], None]], object]:
    """What transfers the session into a dataset, and calls back for every attempt."""
    if how == "merge":
        return lambda target, on_attempt: merge(recorded, target, on_attempt=on_attempt)
    source = folder / f"out.{how}"
    if how == "images":
        write_images(source, SIZE)
    else:
        export_dataset(recorded, source, format=how)
    return lambda target, on_attempt: import_dataset(source, target.path, on_attempt=on_attempt)


@pytest.mark.parametrize("how", ["merge", "hdf5", "lerobot", "zarr", "images"])
def test_a_transfer_outlasts_any_collection(
    recorded: GraspDataset, target: GraspRepository, tmp_path: Path, how: str
) -> None:
    deleted: list[int] = []
    transfer = transferring(how, recorded, tmp_path)
    transfer(target, lambda: deleted.append(delete_what_is_old(target.folder)) if not deleted else None)
    report = verify(GraspDataset(target, ref="main"))
    assert (report.ok, report.checked) == (True, SIZE + 1)
    assert delete_what_is_old(target.folder) == 0, "everything that was written is in the dataset"


def test_an_import_that_sleeps_for_hours_is_still_at_work(
    recorded: GraspDataset, target: GraspRepository, tmp_path: Path
) -> None:
    export_dataset(recorded, tmp_path / "out.hdf5", format="hdf5")
    command = waiting_import(tmp_path / "out.hdf5", target.path)
    with Popen(command, stdin=PIPE, stdout=PIPE, text=True) as importer:
        assert importer.stdout is not None
        assert importer.stdout.readline() == "half way\n"
        importer.send_signal(signal.SIGSTOP)
        os.waitpid(importer.pid, os.WUNTRACED)
        report = collect_garbage(target, datetime.now(UTC) + AHEAD, dry_run=False, grace=-AHEAD)
        (writer,) = report.writers
        assert (writer.pid, writer.what) == (importer.pid, "import out.hdf5 (hdf5)")
        assert report.retained_by == (writer.id,)
        importer.send_signal(signal.SIGCONT)
        output, _ = importer.communicate("go on\n")
    assert output == f"added {SIZE}\n"
    assert verify(GraspDataset(target, ref="main")).ok
    assert collect_garbage(target, dry_run=True).writers == ()


def test_what_a_killed_import_wrote_is_garbage_at_once(
    recorded: GraspDataset, target: GraspRepository, tmp_path: Path
) -> None:
    export_dataset(recorded, tmp_path / "out.hdf5", format="hdf5")
    command = waiting_import(tmp_path / "out.hdf5", target.path)
    with Popen(command, stdin=PIPE, stdout=PIPE, text=True) as importer:
        assert importer.stdout is not None
        assert importer.stdout.readline() == "half way\n"
        importer.kill()
    assert delete_what_is_old(target.folder) >= 16
    assert verify(GraspDataset(target, ref="main")).ok


def test_a_collection_that_knew_nothing_of_a_transfer_makes_it_fail(
    recorded: GraspDataset, target: GraspRepository
) -> None:
    before = target.resolve("main")
    calls: list[int] = []

    def on_attempt() -> None:
        calls.append(0)
        if len(calls) == SIZE:
            delete_unawares(target.folder)

    with pytest.raises(StorageError, match="deleted before it could be committed"):
        merge(recorded, target, on_attempt=on_attempt)
    assert target.resolve("main") == before
    assert verify(GraspDataset(target, ref="main")).ok


def test_a_transfer_whose_version_is_expired_is_made_again_from_the_new_tip(
    recorded: GraspDataset, target: GraspRepository
) -> None:
    """Others commit, and somebody expires and deletes everything that has no name, the transfer's chunks included."""
    other = SessionWriter.resume(GraspRepository.open(target.path), OTHER)
    calls: list[int] = []

    def on_attempt() -> None:
        calls.append(0)
        if len(calls) == SIZE:
            other.append(make_attempt(OTHER, other.next_number))
            other.commit()
            delete_unawares(target.folder)

    assert merge(recorded, target, on_attempt=on_attempt).attempts == SIZE
    assert len(calls) == SIZE
    report = verify(GraspDataset(target, ref="main"))
    assert (report.ok, report.checked) == (True, SIZE + 2)


def test_a_commit_whose_version_is_expired_is_made_again_from_the_new_tip(
    target: GraspRepository, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = SessionWriter.resume(GraspRepository.open(target.path), OTHER)
    writer = SessionWriter.begin(target, HEADER)
    for number in range(3):
        writer.append(make_attempt(HEADER, number))
        stale = [target.writable("main")]
        other.append(make_attempt(OTHER, other.next_number))
        other.commit()
        delete_unawares(target.folder)
        fresh = target.writable
        with monkeypatch.context() as patch:
            patch.setattr(target, "writable", lambda branch, old=stale, new=fresh: old.pop() if old else new(branch))
            writer.commit()
        assert stale == []
    sessions = {one.header.seed: one.attempts for one in GraspDataset.open(str(target.path)).sessions}
    assert sessions == {1: 3, 2: 4}
    assert verify(GraspDataset.open(str(target.path))).ok


def test_a_recorder_goes_on_beside_endless_expiry_and_collection(target: GraspRepository) -> None:
    command = [sys.executable, "-P", str(PROGRAM), str(target.path), "7", "30", "1"]
    other = SessionWriter.resume(GraspRepository.open(target.path), OTHER)
    with Popen(command, stdin=PIPE, stdout=PIPE, text=True) as recorder:
        assert recorder.stdin is not None
        assert recorder.stdout is not None
        recorder.stdin.write("go\n")
        recorder.stdin.flush()
        for line in recorder.stdout:
            if line.startswith("committed"):
                other.append(make_attempt(OTHER, other.next_number))
                other.commit()
                delete_what_is_old(target.folder)
    assert recorder.returncode == 0
    dataset = GraspDataset.open(str(target.path))
    assert {one.header.seed: one.attempts for one in dataset.sessions} == {7: 30, 2: 31}
    assert verify(dataset).ok
