"""What the disk, or a bucket, has lost of the names of versions is given back, with all that was committed."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zarr
from pyarrow.fs import S3FileSystem
from tests.support.factories import make_attempt, make_header
from tests.support.s3_server import empty_bucket, s3_server
from tests.support.versions import grow, opened

from handsight.cli.app import run
from handsight.datasets import (
    CorruptDataError,
    GraspRepository,
    SessionWriter,
    collect_garbage,
    create_branch,
    delete_branch,
    verify,
)
from handsight.datasets.address import S3Prefix
from handsight.datasets.store.agreement import lost_refs
from handsight.datasets.store.files import names_in
from handsight.datasets.store.releases import LEDGER_BRANCH
from handsight.datasets.store.restoring import restore_main, restore_refs


def _flip(folder: Path) -> None:
    content = bytearray((folder / "ref.json").read_bytes())
    content[15] ^= 1  # Within the snapshot's id.
    (folder / "ref.json").write_bytes(content)


HARM: dict[str, Callable[[Path], object]] = {
    "flipped": _flip,
    "zeroed": lambda folder: (folder / "ref.json").write_bytes(bytes(30)),
    "emptied": lambda folder: (folder / "ref.json").write_bytes(b""),
    "file gone": lambda folder: (folder / "ref.json").unlink(),
    "folder gone": shutil.rmtree,
}


def refs_of(repository: GraspRepository) -> Path:
    return repository.folder / "refs"


@pytest.mark.parametrize("harm", HARM)
def test_a_lost_branch_gets_all_that_was_committed_to_it(repository: GraspRepository, harm: str) -> None:
    grow(repository, 3)
    create_branch(repository, "dev")
    tip = grow(repository, 6, "dev")
    grow(repository, 9)
    HARM[harm](refs_of(repository) / "branch.dev")

    reopened = GraspRepository.open(repository.path)
    with pytest.raises(CorruptDataError, match=r"branch 'dev'.*dataset repair"):
        collect_garbage(reopened, dry_run=False)
    (planned,) = restore_refs(reopened, dry_run=True)
    assert [one.name for one in lost_refs(reopened)] == ["dev"]
    assert restore_refs(reopened) == (planned,)
    assert (planned.kind, planned.name, planned.snapshot_id) == ("branch", "dev", tip)
    assert "newest of 1 commit" in planned.source
    assert verify(opened(reopened, "dev")).ok
    assert lost_refs(GraspRepository.open(repository.path)) == []


@pytest.mark.parametrize("harm", HARM)
def test_a_lost_main_branch_gets_all_that_was_committed_to_it(
    repository: GraspRepository, harm: str, capsys: pytest.CaptureFixture[str]
) -> None:
    grow(repository, 3)
    create_branch(repository, "dev")
    dev = grow(repository, 5, "dev")
    tip = grow(repository, 6)
    HARM[harm](refs_of(repository) / "branch.main")
    shutil.rmtree(refs_of(repository) / "branch.dev")

    path = str(repository.path)
    assert run(["dataset", "info", path]) == 2
    assert "dataset repair" in capsys.readouterr().err
    before = sorted(refs_of(repository).rglob("*"))
    assert run(["dataset", "repair", path, "--branch", "mended", "--dry-run", "--json"]) == 0
    planned = json.loads(capsys.readouterr().out)
    assert planned["restored"] == ["main", "dev"]
    assert sorted(refs_of(repository).rglob("*")) == before
    assert run(["dataset", "repair", path, "--branch", "mended", "--json"]) == 0
    done = json.loads(capsys.readouterr().out)
    assert done["restored_refs"] == planned["restored_refs"]
    assert (done["branch"], done["lost_refs"]) == (None, [])
    assert GraspRepository.open(path).branches() == {"dev": dev, "main": tip}


def test_a_lost_branch_that_nothing_was_committed_to_is_where_it_began(repository: GraspRepository) -> None:
    began = grow(repository, 3)
    create_branch(repository, "dev")
    grow(repository, 6)
    shutil.rmtree(refs_of(repository) / "branch.dev")
    (restored,) = restore_refs(GraspRepository.open(repository.path))
    assert restored.snapshot_id == began
    assert "where it began" in restored.source


def test_commits_of_a_deleted_branch_are_not_those_of_its_successor(repository: GraspRepository) -> None:
    grow(repository, 3)
    create_branch(repository, "dev")
    grow(repository, 6, "dev")
    delete_branch(repository, "dev", force=True)
    began = grow(repository, 4)
    create_branch(repository, "dev")
    shutil.rmtree(refs_of(repository) / "branch.dev")
    (restored,) = restore_refs(GraspRepository.open(repository.path))
    assert restored.snapshot_id == began


def test_commits_that_do_not_say_their_branch_are_found_by_their_history(repository: GraspRepository) -> None:
    """As an older handsight made them."""
    grow(repository, 3)
    create_branch(repository, "dev")
    engine = repository.icechunk_repository
    for branch, number in (("dev", 0), ("main", 1), ("dev", 2)):
        transaction = engine.writable_session(branch)
        zarr.open_group(transaction.store, mode="r+").attrs["test"] = number
        transaction.commit(f"commit {number}")
    tip = engine.lookup_branch("dev")
    shutil.rmtree(refs_of(repository) / "branch.dev")
    (restored,) = restore_refs(GraspRepository.open(repository.path))
    assert restored.snapshot_id == tip
    shutil.rmtree(refs_of(repository) / "branch.main")
    (main,) = restore_main(repository.folder)
    assert main.snapshot_id == engine.lookup_branch("main")


def test_the_ledger_comes_back_and_with_it_the_names_it_knows(repository: GraspRepository) -> None:
    released = grow(repository, 3)
    repository.release("v1")
    create_branch(repository, "dev")
    for name in (f"branch.{LEDGER_BRANCH}", "tag.v1", "branch.dev"):
        shutil.rmtree(refs_of(repository) / name)
    reopened = GraspRepository.open(repository.path)
    report = verify(opened(reopened))
    assert [("list of releases" in one) for one in report.lost_refs] == [True]
    with pytest.raises(CorruptDataError, match="list of releases"):
        collect_garbage(reopened, dry_run=False)
    assert [one.name for one in restore_refs(reopened)] == [LEDGER_BRANCH, "v1", "dev"]
    again = GraspRepository.open(repository.path)
    assert lost_refs(again) == []
    assert (again.resolve("v1"), again.resolve("dev")) == (released, released)


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """Address of a server that runs until the end of the file."""
    with s3_server() as address:
        yield address


@pytest.fixture
def bucket(server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> GraspRepository:
    """A dataset in a bucket."""
    empty_bucket(server, monkeypatch)
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    return GraspRepository.create("s3://lab/week/grasps")


def test_names_that_a_bucket_has_lost_come_back(bucket: GraspRepository) -> None:
    assert isinstance(bucket.path, S3Prefix)
    header = make_header()
    with SessionWriter.begin(bucket, header) as writer:
        writer.append(make_attempt(header, 0))
    released = bucket.resolve("main")
    bucket.release("v1")
    bucket.release("v2")
    create_branch(bucket, "dev")
    with SessionWriter.begin(bucket, make_header(seed=2), branch="dev") as writer:
        writer.append(make_attempt(make_header(seed=2), 0))
    tip = bucket.resolve("dev")
    assert names_in(bucket.path, "refs/tag.v1") == ["ref.json"]
    files = S3FileSystem(endpoint_override=os.environ["AWS_ENDPOINT_URL"].partition("://")[2], scheme="http")
    files.delete_file("lab/week/grasps/refs/tag.v1/ref.json")
    files.delete_file("lab/week/grasps/refs/branch.dev/ref.json")
    with files.open_output_stream("lab/week/grasps/refs/tag.v2/ref.json") as stream:
        stream.write(b"{}")

    reopened = GraspRepository.open(bucket.path)
    assert {one.name for one in lost_refs(reopened)} == {"v1", "v2", "dev"}
    assert len(restore_refs(reopened)) == 3
    again = GraspRepository.open(bucket.path)
    assert lost_refs(again) == []
    assert [again.resolve(name) for name in ("v1", "v2", "dev")] == [released, released, tip]
