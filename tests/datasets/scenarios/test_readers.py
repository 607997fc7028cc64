"""Versions are expired and collected while somebody reads them: they stay, or it is said that they were removed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.garbage import AHEAD, delete_unawares, delete_what_is_old
from tests.support.s3_server import empty_bucket, s3_server

from handsight.datasets import (
    GraspDataset,
    GraspRepository,
    Outcome,
    SessionWriter,
    VersionRemovedError,
    collect_garbage,
    create_branch,
    delete_branch,
    expire,
    export_dataset,
    import_dataset,
    materialize,
    verify,
)
from handsight.datasets.exchange.merge import merge
from handsight.datasets.format.schema import attempt_id
from handsight.datasets.store.refs import ref_names
from handsight.servoing.homography import InputGrid

SIZE = 72
"""Of the first session: more than verify checks before it tells how far it is."""
HEADER = make_header(width=64, height=48)
OTHER = make_header(seed=2, width=64, height=48)
GRID = InputGrid(crop_px=40, size_px=8)

Read = Callable[[GraspDataset, Callable[[], None], Path], None]


def do_export(dataset: GraspDataset, tell: Callable[[], None], folder: Path) -> None:
    export_dataset(dataset, folder / "out.hdf5", format="hdf5", on_attempt=tell)
    import_dataset(folder / "out.hdf5", folder / "back")
    assert GraspDataset.open(f"{folder}/back").digest == dataset.digest


def do_merge(dataset: GraspDataset, tell: Callable[[], None], folder: Path) -> None:
    merge(dataset, GraspRepository.create(folder / "merged"), on_attempt=tell)
    assert GraspDataset.open(f"{folder}/merged").digest == dataset.digest


def do_materialize(dataset: GraspDataset, tell: Callable[[], None], folder: Path) -> None:
    assert len(materialize(dataset, grid=GRID, on_attempt=tell).inputs) == SIZE + 3


def do_verify(dataset: GraspDataset, tell: Callable[[], None], folder: Path) -> None:
    report = verify(dataset, on_checked=lambda _: tell())
    assert (report.ok, report.checked) == (True, SIZE + 3)


READS: dict[str, Read] = {"export": do_export, "merge": do_merge, "materialize": do_materialize, "verify": do_verify}


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """Address of a server that runs until the end of the file."""
    with s3_server() as address:
        yield address


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset with a session and the beginning of another."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("recorded") / "grasps")
    record(repository, HEADER, [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(SIZE)], every=36)
    with SessionWriter.begin(repository, OTHER) as writer:
        for number in range(3):
            writer.append(make_attempt(OTHER, number, outcome=Outcome.HELD))
    return repository.folder


@pytest.fixture
def local(recorded: Path, tmp_path: Path) -> GraspRepository:
    """A copy of it."""
    return GraspRepository.open(shutil.copytree(recorded, tmp_path / "grasps"))


@pytest.fixture
def remote(recorded: Path, server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> GraspRepository:
    """The same in a bucket."""
    empty_bucket(server, monkeypatch)
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    repository = GraspRepository.create("s3://lab/grasps")
    merge(GraspDataset.open(str(recorded)), repository)
    return repository


def go_on(repository: GraspRepository) -> None:
    """Commit to the second session, so that the version before is one that no name leads to."""
    with closing(SessionWriter.resume(GraspRepository.open(repository.path), OTHER)) as writer:
        writer.append(make_attempt(OTHER, writer.next_number))
        writer.seal()


def once(act: Callable[[], object]) -> Callable[[], None]:
    done: list[object] = []
    return lambda: None if done else done.append(act())


@pytest.mark.parametrize("how", READS)
def test_a_version_stays_while_it_is_read(local: GraspRepository, tmp_path: Path, how: str) -> None:
    dataset = GraspDataset.open(str(local.path))

    def others() -> None:
        go_on(local)
        delete_what_is_old(local.path)
        (reader,) = expire(GraspRepository.open(local.path), datetime.now(UTC) + AHEAD, dry_run=True).writers
        assert reader.reads == dataset.snapshot_id
        assert local.is_stored(dataset.snapshot_id)

    READS[how](dataset, once(others), tmp_path)
    delete_what_is_old(local.path)
    assert not local.is_stored(dataset.snapshot_id), "nobody reads it any more"


@pytest.mark.parametrize("how", ["export", "merge"])
def test_a_version_in_a_bucket_stays_while_it_is_read_elsewhere(
    remote: GraspRepository, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    dataset = GraspDataset.open("s3://lab/grasps")

    def others() -> None:
        monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "other-machine"))
        go_on(remote)
        delete_what_is_old(remote.path)
        report = collect_garbage(GraspRepository.open(remote.path), dry_run=True)
        assert [(one.what, one.reads) for one in report.writers] == [("read", dataset.snapshot_id)]

    READS[how](dataset, once(others), tmp_path)
    assert [one for one in ref_names(remote.path)[1] if one.startswith("handsight.reader.")] == []
    delete_what_is_old(remote.path)
    assert not remote.is_stored(dataset.snapshot_id), "nobody reads it any more"


def test_a_branch_that_is_deleted_stays_while_it_is_read(local: GraspRepository, tmp_path: Path) -> None:
    create_branch(local, "dev")
    with SessionWriter.resume(local, OTHER, "dev") as writer:
        writer.append(make_attempt(OTHER, writer.next_number))
    dataset = GraspDataset.open(f"{local.path}@dev")

    def others() -> None:
        delete_branch(local, "dev", force=True)
        assert delete_what_is_old(local.path) == 0
        report = collect_garbage(local, dry_run=True)
        assert report.retained_by == (report.writers[0].id,)

    export_dataset(dataset, tmp_path / "out.hdf5", format="hdf5", on_attempt=once(others))
    assert delete_what_is_old(local.path) > 0


@pytest.mark.parametrize("how", READS)
def test_whoever_could_not_register_is_told_that_the_version_was_removed(
    local: GraspRepository, tmp_path: Path, how: str
) -> None:
    (local.folder / ".handsight" / "writers").rename(local.folder / ".handsight" / "others")
    (local.folder / ".handsight" / "writers").write_text("not a folder, so nobody can register")
    dataset = GraspDataset.open(str(local.path))

    def others() -> None:
        (local.folder / ".handsight" / "writers").unlink()
        go_on(local)
        delete_unawares(local.path)

    with pytest.raises(VersionRemovedError, match="was removed by gc while it was being read: start again"):
        READS[how](dataset, once(others), tmp_path)
    assert not list(tmp_path.glob("out.hdf5*")), "nothing is left half done"


def test_reading_by_hand_says_so_too(local: GraspRepository) -> None:
    """Of the session that went on nothing had been read, and its columns have been written anew since."""
    dataset = GraspDataset.open(str(local.path))
    first = attempt_id(dataset.sessions[-1].ulid, 0)
    go_on(local)
    delete_unawares(local.path)
    with pytest.raises(VersionRemovedError):
        dataset.attempt(first)
    with pytest.raises(VersionRemovedError):
        dataset.frame(first)
    with pytest.raises(VersionRemovedError):
        dataset.info()


def test_the_entry_of_a_killed_reader_goes_with_the_next_one(local: GraspRepository) -> None:
    program = (
        "import os, sys; from handsight.datasets import GraspRepository; "
        "from handsight.datasets.store.writers import register_reader; "
        "repository = GraspRepository.open(sys.argv[1]); "
        "entry = register_reader(repository, repository.resolve('main'), 'export'); os._exit(9)"
    )
    words = [sys.executable, "-P", "-c", program, str(local.path)]
    assert subprocess.run(words, timeout=60, check=False).returncode == 9
    entries = local.side_folder / "writers"
    (left,) = entries.glob("*.json")
    assert verify(GraspDataset.open(str(local.path))).ok
    assert not left.exists()
    assert list(entries.glob("*.json")) == []
