"""Datasets of every schema there was, written by the handsight of that time, come forward with nothing lost.

``golden/schema-N.zip`` is such a dataset, ``schema-N.json`` what that handsight said of it, and ``exports`` holds what
it exported. Never rewrite them: add some for each new schema.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
import zarr
from tests.support.factories import make_attempt, make_header, record

from handsight.cli.app import run
from handsight.datasets import (
    CorruptDataError,
    GraspDataset,
    GraspRepository,
    RefNameError,
    SchemaError,
    Selection,
    SessionWriter,
    migrate,
    verify,
)
from handsight.datasets.curation.curator import Curator
from handsight.datasets.exchange.commands import import_dataset
from handsight.datasets.exchange.merge import merge
from handsight.datasets.format.schema import SCHEMA_VERSION

GOLDEN = Path(__file__).parents[1] / "scenarios" / "golden"
OLDER = range(1, SCHEMA_VERSION)


def unpacked(schema: int, folder: Path) -> Path:
    with zipfile.ZipFile(GOLDEN / f"schema-{schema}.zip") as archive:
        archive.extractall(folder / "grasps")
    return folder / "grasps"


def expected(schema: int) -> dict[str, Any]:
    recorded: dict[str, Any] = json.loads((GOLDEN / f"schema-{schema}.json").read_text())
    return recorded


def test_there_is_a_golden_dataset_of_every_older_schema() -> None:
    assert sorted(GOLDEN.glob("*.zip")) == [GOLDEN / f"schema-{schema}.zip" for schema in OLDER]


@pytest.mark.parametrize("schema", OLDER)
def test_a_migrated_dataset_is_what_it_was(schema: int, tmp_path: Path) -> None:
    path = unpacked(schema, tmp_path)
    repository = GraspRepository.open(path)
    before = repository.branches()
    done = migrate(repository, "new")
    assert done is not None
    assert (done.schema_before, done.schema_after, done.sessions) == (schema, SCHEMA_VERSION, 2)
    assert repository.branches() == {**before, "new": done.snapshot}
    dataset = GraspDataset.open(f"{path}@new")
    recorded = expected(schema)
    table = dataset.attempts
    assert list(table.index) == list(recorded["attempts"])
    for identity, row in recorded["attempts"].items():
        found = table.loc[identity, ["outcome", "digest", "excluded", "success"]]
        assert found.where(found.notna(), None).to_dict() == row
    info = dataset.info()
    assert (info.digest, info.curation_digest) == (recorded["digest"], recorded["curation_digest"])
    assert info.schema_version == SCHEMA_VERSION
    report = verify(dataset)
    assert report.ok
    assert report.checked == len(table)


@pytest.mark.parametrize("format", ["hdf5", "zarr", "lerobot"])
@pytest.mark.parametrize("schema", OLDER)
def test_an_export_of_an_older_schema_is_imported_whole(schema: int, format: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(GOLDEN / "exports" / f"schema-{schema}.{format}.zip") as archive:
        archive.extractall(tmp_path)
    import_dataset(tmp_path / f"grasps.{format}", tmp_path / "new")
    dataset = GraspDataset.open(f"{tmp_path}/new")
    info, recorded = dataset.info(), expected(schema)
    assert (info.digest, info.curation_digest) == (recorded["digest"], recorded["curation_digest"])
    assert dict(dataset.attempts["excluded"]) == {key: row["excluded"] for key, row in recorded["attempts"].items()}
    assert verify(dataset).ok


@pytest.mark.parametrize("schema", OLDER)
def test_a_migrated_dataset_can_be_worked_with(schema: int, tmp_path: Path) -> None:
    path = unpacked(schema, tmp_path)
    repository = GraspRepository.open(path)
    migrate(repository, "new")
    with SessionWriter.begin(repository, make_header(seed=9), branch="new") as writer:
        writer.append(make_attempt(make_header(seed=9), 0))
    Curator(repository, author="anna", branch="new").exclude(Selection(where="number == 0"), "first of each")
    repository.release("v2", "new")
    dataset = GraspDataset.open(f"{path}@v2")
    assert len(dataset.attempts) == len(expected(schema)["attempts"]) + 1
    assert verify(dataset).ok


@pytest.mark.parametrize("ref", ["main", "v1"])
def test_an_older_version_is_refused_with_the_command_that_helps(ref: str, tmp_path: Path) -> None:
    path = unpacked(1, tmp_path)
    with pytest.raises(SchemaError, match=f"handsight dataset migrate {path}@{ref} --branch schema-{SCHEMA_VERSION}"):
        GraspDataset.open(f"{path}@{ref}")
    older = GraspRepository.open(path)
    before = older.branches()
    with pytest.raises(SchemaError, match="migrate"):
        SessionWriter.begin(older, make_header(seed=9))
    with pytest.raises(SchemaError, match="migrate"):
        Curator(older, author="anna").exclude(Selection(where="number == 0"), "first of each")
    newer = GraspRepository.create(tmp_path / "newer")
    record(newer, make_header(seed=9), [make_attempt(make_header(seed=9), 0)])
    with pytest.raises(SchemaError, match="migrate"):
        merge(GraspDataset.open(str(newer.path)), older)
    assert older.branches() == before


def test_the_command_says_what_it_did_and_when_there_is_nothing_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = unpacked(1, tmp_path)
    assert run(["dataset", "migrate", str(path), "--branch", "new"]) == 0
    assert f"2 sessions upgraded from schema 1 to {SCHEMA_VERSION}" in " ".join(capsys.readouterr().out.split())
    assert run(["dataset", "migrate", f"{path}@new", "--branch", "again"]) == 0
    assert "no branch was made" in capsys.readouterr().out
    assert run(["dataset", "info", str(path)]) == 2
    assert "handsight dataset migrate" in capsys.readouterr().err


def test_a_release_can_be_migrated_after_the_branch_was(tmp_path: Path) -> None:
    path = unpacked(1, tmp_path)
    repository = GraspRepository.open(path)
    first, second = migrate(repository, "a"), migrate(repository, "b", ref="v1")
    assert first is not None
    assert second is not None
    assert GraspDataset.open(f"{path}@a").digest == GraspDataset.open(f"{path}@b").digest
    assert migrate(repository, "c", ref="a") is None
    assert "c" not in repository.branches()


def test_a_taken_name_changes_nothing(tmp_path: Path) -> None:
    repository = GraspRepository.open(unpacked(1, tmp_path))
    before = repository.branches()
    with pytest.raises(RefNameError, match="taken"):
        migrate(repository, "main")
    assert repository.branches() == before


def test_damage_is_not_hidden_by_a_new_digest(tmp_path: Path) -> None:
    repository = GraspRepository.open(unpacked(1, tmp_path))
    transaction = repository.writable("main")
    session = next(iter(zarr.open_group(transaction.store, mode="r+")["sessions"].groups()))[1]  # type: ignore[union-attr]
    session.attrs["started"] = "1999-01-01T00:00:00+00:00"
    repository.commit(transaction, branch="main", message="tamper")
    before = repository.branches()
    with pytest.raises(CorruptDataError, match="are not as recorded"):
        migrate(repository, "new")
    assert repository.branches() == before
