"""What a bucket is asked for, each request a round trip: no more than needed, however many releases and branches."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import icechunk
import pytest
import zarr
from tests.support.factories import make_attempt, make_header, record
from tests.support.s3_server import empty_bucket, requests_since, s3_server

from handsight.datasets import GraspDataset, GraspRepository, SessionWriter, create_branch
from handsight.datasets.address import location_of
from handsight.datasets.store.icechunk_engine import storage_at

HEADER = make_header()
RELEASES, BRANCHES = 20, 6

Action = Callable[[str], object]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server that holds a dataset with few names and the same with many."""
    with s3_server() as address, pytest.MonkeyPatch.context() as patch:
        empty_bucket(address, patch)
        patch.setenv("HANDSIGHT_CACHE", str(tmp_path_factory.mktemp("cache")))
        for name in ("few", "many"):
            repository = GraspRepository.create(f"s3://lab/{name}")
            record(repository, HEADER, [make_attempt(HEADER, number) for number in range(4)])
            repository.release("v1")
        for number in range(2, RELEASES + 1):
            repository.release(f"v{number}")
        for number in range(1, BRANCHES):
            create_branch(repository, f"b{number}")
        yield address


def asked(server: str, action: Action, name: str) -> list[str]:
    requests_since(server)
    action(f"s3://lab/{name}")
    # Whether there is a file of a later format is asked again now and then, by the client itself.
    return [one.replace(f"/lab/{name}/", "/") for one in requests_since(server) if not one.endswith("/repo")]


def icechunk_alone(address: str) -> object:
    session = icechunk.Repository.open(storage_at(location_of(address))).readonly_session(tag="v1")
    return zarr.open_group(session.store, mode="r")


def commit(address: str) -> None:
    header = make_header(seed=2)
    with SessionWriter.begin(GraspRepository.open(address), header) as writer:
        writer.append(make_attempt(header, 0))


READING: dict[str, Action] = {
    "open a release": lambda at: GraspDataset.open(f"{at}@v1"),
    "open main": GraspDataset.open,
    "info": lambda at: GraspDataset.open(f"{at}@v1").info(),
    "ls": lambda at: GraspDataset.open(f"{at}@v1").tail(20),
    "attempts": lambda at: GraspDataset.open(f"{at}@v1").attempts,
    "an attempt": lambda at: GraspDataset.open(f"{at}@v1").attempt(GraspDataset.open(f"{at}@v1").tail(1).index[0]),
    "releases": lambda at: GraspRepository.open(at).releases(),
    "is a name taken": lambda at: GraspRepository.open(at).is_taken("v2000"),
}


@pytest.mark.parametrize("action", READING)
def test_reading_asks_for_nothing_that_grows_with_the_names(server: str, action: str) -> None:
    few, many = (asked(server, READING[action], name) for name in ("few", "many"))
    assert len(many) == len(few)


def test_opening_a_release_asks_for_no_more_than_icechunk_does(server: str) -> None:
    floor = set(asked(server, icechunk_alone, "many"))
    opened = asked(server, READING["open a release"], "many")
    assert sorted(opened) == sorted(set(opened)), "nothing is asked for twice"
    assert set(opened) <= floor


def test_the_log_asks_for_each_branch_once(server: str) -> None:
    few, many = (asked(server, lambda at: GraspRepository.open(at).log(), name) for name in ("few", "many"))
    assert len(many) == len(few) + BRANCHES - 1


def test_a_commit_asks_for_nothing_that_grows_with_the_names(server: str) -> None:
    few, many = (asked(server, commit, name) for name in ("few", "many"))
    assert len(many) == len(few)
    assert [one for one in many if "/refs/tag." in one or "list-type" in one] == []


def test_a_release_asks_for_nothing_that_grows_with_the_names(server: str) -> None:
    few, many = (asked(server, lambda at: GraspRepository.open(at).release("new"), name) for name in ("few", "many"))
    assert len(many) == len(few)
    assert {one.name for one in GraspRepository.open("s3://lab/many").releases().values()} >= {"v1", "v20", "new"}
