"""The same datasets in a bucket, on a server of this machine that speaks S3."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from subprocess import PIPE, Popen

import pytest
from tests.support.factories import difference, make_attempt, make_header, record
from tests.support.s3_server import empty_bucket, s3_server

from handsight.datasets import (
    DatasetExistsError,
    DatasetNotFoundError,
    GraspDataset,
    GraspRepository,
    Outcome,
    RefNameError,
    SessionConflictError,
    SessionWriter,
    StorageError,
    export_dataset,
    import_dataset,
)
from handsight.datasets.curation.curator import Curator
from handsight.datasets.exchange.merge import merge
from handsight.datasets.inputs.materialize import materialize
from handsight.datasets.reading.selection import Selection
from handsight.datasets.store.releases import LEDGER_BRANCH
from handsight.servoing.homography import InputGrid

PROGRAM = Path(__file__).parents[2] / "support" / "factories.py"
ADDRESS = "s3://lab/week/grasps"
WRITERS = 5


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """Address of a server that runs until the end of the file."""
    with s3_server() as address:
        yield address


@pytest.fixture(autouse=True)
def bucket(server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty bucket ``lab``, in the environment that people have who use one."""
    empty_bucket(server, monkeypatch)
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))


def test_a_dataset_in_a_bucket_is_like_any_other(tmp_path: Path) -> None:
    with pytest.raises(DatasetNotFoundError, match="s3://lab/week/grasps"):
        GraspRepository.open(ADDRESS)
    repository = GraspRepository.create(ADDRESS)
    with pytest.raises(DatasetExistsError, match="s3://lab/week/grasps"):
        GraspRepository.create(ADDRESS)
    header = make_header()
    attempts = [make_attempt(header, number) for number in range(6)]
    record(repository, header, attempts)
    repository.release("v1", message="first")
    record(GraspRepository.create(tmp_path / "local"), header, attempts)
    local, remote = GraspDataset.open(f"{tmp_path}/local"), GraspDataset.open(f"{ADDRESS}@v1")
    assert remote.digest == local.digest
    assert remote.info().bytes > 0
    assert [entry.attempts_added for entry in repository.log()] == [2, 4, 0]
    assert repository.log()[0].refs == ("v1", "main")
    for identity, attempt in zip(remote.attempts.index, attempts, strict=True):
        assert difference(remote.attempt(identity), attempt) is None
    Curator(repository, author="jo").exclude(Selection(ids=(remote.attempts.index[0],)), "dark")
    assert GraspDataset.open(ADDRESS).info().excluded == 1
    assert remote.info().excluded == 0


def test_sessions_travel_between_bucket_and_disk(tmp_path: Path) -> None:
    header = make_header()
    here = GraspRepository.create(tmp_path / "local")
    record(here, header, [make_attempt(header, number) for number in range(5)])
    remote = GraspRepository.create(ADDRESS)
    assert merge(GraspDataset(here, ref="main"), remote).attempts == 5
    export_dataset(GraspDataset.open(ADDRESS), tmp_path / "out.zarr", format="zarr")
    assert import_dataset(tmp_path / "out.zarr", ADDRESS).transfer.attempts == 0
    import_dataset(tmp_path / "out.zarr", tmp_path / "back")
    assert GraspDataset.open(f"{tmp_path}/back").digest == GraspDataset(here, ref="main").digest


def test_caches_of_a_bucket_are_local(tmp_path: Path) -> None:
    header = make_header(width=64, height=48)
    repository = GraspRepository.create(ADDRESS)
    record(repository, header, [make_attempt(header, 0, outcome=Outcome.HELD)])
    grid = InputGrid(crop_px=40, size_px=8)
    assert materialize(GraspDataset.open(ADDRESS), grid=grid).inputs.shape == (1, 4, 8, 8)
    (file,) = (tmp_path / "cache" / "datasets").rglob("*.npy")
    uuid = file.relative_to(tmp_path / "cache" / "datasets").parts[0]
    assert uuid == repository.root(repository.resolve("main")).attrs["dataset_uuid"]


def test_writers_at_once_lose_nothing(tmp_path: Path) -> None:
    repository = GraspRepository.create(ADDRESS)
    expected = GraspRepository.create(tmp_path / "expected")
    command = [sys.executable, "-P", str(PROGRAM), ADDRESS]
    with ExitStack() as stack:
        writers = [
            stack.enter_context(Popen([*command, str(seed), "4", "1"], stdin=PIPE, stdout=PIPE, text=True))
            for seed in range(WRITERS)
        ]
        for writer in writers:
            assert writer.stdin is not None
            writer.stdin.write("go\n")
            writer.stdin.flush()
        for writer in writers:
            output, _ = writer.communicate(timeout=200)
            assert writer.returncode == 0
            assert output.count("committed") == 4
    for seed in range(WRITERS):
        header = make_header(seed=seed)
        record(expected, header, [make_attempt(header, number) for number in range(4)])
    assert GraspDataset.open(ADDRESS).digest == GraspDataset(expected, ref="main").digest
    assert sum(entry.attempts_added for entry in repository.log()) == 4 * WRITERS


def test_two_who_begin_the_same_session_cannot_both_win() -> None:
    GraspRepository.create(ADDRESS)
    header = make_header(seed=7)
    one, two = (SessionWriter.begin(GraspRepository.open(ADDRESS), header) for _ in range(2))
    for writer in (one, two):
        writer.append(make_attempt(header, 0))
    stale = two.repository.writable("main")
    one.commit()
    # Its tip has moved meanwhile.
    two.repository.writable = lambda branch, **_: stale  # type: ignore[method-assign]
    with pytest.raises(SessionConflictError, match="already holds session"):
        two.commit()
    assert len(GraspDataset.open(ADDRESS).attempts) == 1


def test_releases_that_meet_are_both_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second writes to the list of releases before the first has committed to it."""
    repository = GraspRepository.create(ADDRESS)
    stale = repository.writable(LEDGER_BRANCH)
    GraspRepository.open(ADDRESS).release("v1", message="first")
    sessions = iter([stale])
    fresh = repository.writable
    monkeypatch.setattr(repository, "writable", lambda branch: next(sessions, None) or fresh(branch))
    repository.release("v2", message="second")
    releases = GraspRepository.open(ADDRESS).releases()
    assert {name: release.message for name, release in releases.items()} == {"v1": "first", "v2": "second"}


def test_one_name_is_released_once(monkeypatch: pytest.MonkeyPatch) -> None:
    repository = GraspRepository.create(ADDRESS)
    monkeypatch.setattr(repository, "is_taken", lambda name: False)  # As it was before the other came.
    GraspRepository.open(ADDRESS).release("v1")
    with pytest.raises(RefNameError, match="somebody has just released 'v1'"):
        repository.release("v1")


def test_decisions_that_meet_are_both_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    repository = GraspRepository.create(ADDRESS)
    header = make_header()
    record(repository, header, [make_attempt(header, number) for number in range(4)])
    first, second, *_ = GraspDataset.open(ADDRESS).attempts.index
    stale = repository.writable("main")
    Curator(GraspRepository.open(ADDRESS), author="jo").exclude(Selection(ids=(first,)), "dark")
    sessions = iter([stale])
    fresh = repository.writable
    monkeypatch.setattr(repository, "writable", lambda branch: next(sessions, None) or fresh(branch))
    Curator(repository, author="kim").exclude(Selection(ids=(second,)), "blurred")
    excluded = GraspDataset.open(ADDRESS).attempts.query("excluded")["exclusion_reason"]
    assert excluded.to_dict() == {first: "dark", second: "blurred"}


def test_a_bucket_out_of_reach_is_an_error_of_storage(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(StorageError, match="cannot open s3://nowhere/grasps"):
        GraspRepository.open("s3://nowhere/grasps")


def test_the_server_is_only_needed_by_this_file() -> None:
    """Nothing of handsight imports the S3 client of Python or the test server."""
    program = "import sys, handsight.datasets; sys.exit(any(name in sys.modules for name in ('boto3', 'moto')))"
    assert subprocess.run([sys.executable, "-P", "-c", program], check=False).returncode == 0
