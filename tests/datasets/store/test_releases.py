"""A release names the very snapshot, once and for all."""

from __future__ import annotations

from typing import Any

import icechunk
import pytest
import zarr
from tests.support.factories import make_attempt, make_header, record
from zarr.storage import MemoryStore

from handsight.datasets import CorruptDataError, GraspDataset, GraspRepository, RefNameError, RefNotFoundError
from handsight.datasets.store import icechunk_engine
from handsight.datasets.store.releases import known_branches, read_ledger


def test_a_release_names_the_very_snapshot_and_never_moves(repository: GraspRepository) -> None:
    header = make_header()
    writer = record(repository, header, [make_attempt(header, 0)])
    tip = repository.resolve("main")
    release = repository.release("v1", "main", "first look")
    assert (release.name, release.snapshot_id, release.message) == ("v1", tip, "first look")
    assert repository.resolve("main") == tip
    writer.append(make_attempt(header, 1))
    writer.commit()
    repository.release("v2", "v1", "the same again")
    reopened = GraspRepository.open(repository.path)
    assert reopened.releases() == {"v1": release, "v2": repository.releases()["v2"]}
    assert reopened.resolve("v1") == reopened.resolve("v2") == tip != reopened.resolve("main")
    assert len(GraspDataset.open(f"{repository.path}@v1").attempts) == 1
    assert len(GraspDataset.open(f"{repository.path}").attempts) == 2


@pytest.mark.parametrize(
    "name", ["", "a/b", "v@1", "-v", ".v", "v 1", "x" * 65, "0" * 20, "main", "handsight.releases"]
)
def test_names_a_release_cannot_take(repository: GraspRepository, name: str) -> None:
    with pytest.raises(RefNameError):
        repository.release(name)
    assert repository.releases() == {}


def test_a_release_name_is_used_once_even_when_deleted(repository: GraspRepository) -> None:
    repository.release("v1")
    with pytest.raises(RefNameError, match="taken"):
        repository.release("v1")
    icechunk.Repository.open(icechunk_engine.storage_at(repository.folder)).delete_tag("v1")
    with pytest.raises(RefNameError, match="deleted"):
        repository.release("v1")
    assert repository.releases() == {}


def test_a_release_of_an_unknown_ref_changes_nothing(repository: GraspRepository) -> None:
    with pytest.raises(RefNotFoundError):
        repository.release("v1", "nope")
    assert repository.releases() == {}
    assert repository.release("v1").name == "v1"


@pytest.mark.parametrize(
    ("attributes", "said"),
    [
        ({"releases": ["v1"]}, r"entries of releases are damaged \(all of them\)"),
        ({"releases": {"v1": "x"}}, r"entries of releases are damaged \(v1\)"),
        ({"releases": {"v1": {"message": "", "released_at": None, "snapshot": 5}}}, r"releases are damaged \(v1\)"),
        ({"releases": {"v1": {"message": ""}}}, "entry of release 'v1' is damaged"),
        ({"releases": {"v1": {"message": "", "released_at": "yesterday"}}}, "entry of release 'v1' is damaged"),
        ({"branches": "main"}, r"entries of branches are damaged \(all of them\)"),
        ({"branches": {"trial": None}}, r"entries of branches are damaged \(trial\)"),
    ],
)
def test_a_ledger_that_nobody_wrote_is_damaged(attributes: dict[str, Any], said: str) -> None:
    ledger = zarr.create_group(MemoryStore(), attributes=attributes)
    with pytest.raises(CorruptDataError, match=said):
        print(read_ledger(ledger, {"v1": "A"}), known_branches(ledger))


def test_a_release_without_a_time_is_read() -> None:
    entry = {"message": "first", "released_at": None, "snapshot": "A"}
    ledger = zarr.create_group(MemoryStore(), attributes={"releases": {"v1": entry}})
    assert read_ledger(ledger, {"v1": "A"})["v1"].released_at is None
