"""``handsight dataset export|import|merge|materialize`` from the outside: statuses, JSON, and what is on disk after."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.factories import make_attempt, make_header, record
from typer.testing import CliRunner

from handsight.cli.dataset.app import dataset_app
from handsight.datasets import GraspDataset, GraspRepository, InterchangeError, MergeError, SessionNotFoundError


def run(*words: object, error: type[Exception] | None = None) -> Any:
    """What a call prints, as JSON; or the error it ends in."""
    result = CliRunner().invoke(dataset_app, [str(word) for word in words] + ["--json"])
    if error is not None:
        assert isinstance(result.exception, error), result.output
        return str(result.exception)
    assert result.exit_code == 0, result.output + repr(result.exception)
    return json.loads(result.output)


@pytest.fixture
def grasps(tmp_path: Path) -> Path:
    header = make_header(width=64, height=48)
    record(GraspRepository.create(tmp_path / "grasps"), header, [make_attempt(header, number) for number in range(9)])
    return tmp_path / "grasps"


@pytest.mark.parametrize("name", ["hdf5", "zarr", "lerobot"])
def test_export_and_import(grasps: Path, tmp_path: Path, name: str) -> None:
    exported = run("export", grasps, tmp_path / "out", "--format", name)
    assert (exported["attempts"], exported["format"]) == (9, name)
    planned = run("import", tmp_path / "out", tmp_path / "back", "--dry-run")
    assert (planned["attempts"], planned["created"], planned["snapshot"]) == (9, False, None)
    assert not (tmp_path / "back").exists()
    done = run("import", tmp_path / "out", tmp_path / "back")
    assert (done["attempts"], done["created"], done["format"]) == (9, True, name)
    assert GraspDataset.open(str(tmp_path / "back")).digest == exported["digest"]
    again = run("import", tmp_path / "out", tmp_path / "back")
    assert (again["attempts"], len(again["duplicates"])) == (0, 1)


def test_merge(grasps: Path, tmp_path: Path) -> None:
    GraspRepository.create(tmp_path / "all")
    ulid = GraspDataset.open(str(grasps)).sessions[0].ulid
    assert run("merge", f"{grasps}@main", tmp_path / "all", "--session", ulid, "--dry-run")["attempts"] == 9
    assert GraspDataset.open(str(tmp_path / "all")).sessions == ()
    assert run("merge", grasps, tmp_path / "all")["sessions"] == [ulid]
    assert run("merge", grasps, tmp_path / "all")["duplicates"] == [ulid]
    assert "nope" in run("merge", grasps, tmp_path / "all", "-s", "nope", error=SessionNotFoundError)
    other = make_header(seed=2, depth_scale_m=0.5)
    record(GraspRepository.create(tmp_path / "other"), other, [make_attempt(other, 0)])
    assert "depth_scale_m" in run("merge", grasps, tmp_path / "other", error=MergeError)
    assert run("merge", grasps, tmp_path / "other", "--allow-mismatch")["attempts"] == 9


def test_materialize(grasps: Path, tmp_path: Path) -> None:
    header = make_header(seed=5, width=420, height=420)
    large = tmp_path / "large"
    record(GraspRepository.create(large), header, [make_attempt(header, number) for number in range(4)])
    facts = run("materialize", large, "--size", 16)
    inputs = np.load(facts["file"])
    assert list(inputs.shape) == facts["shape"] == [len(inputs), 4, 16, 16]
    result = CliRunner().invoke(dataset_app, ["materialize", str(large), "--viewpoint", "side"])
    assert result.exit_code == 2
    assert "'side' is not one of 'overhead', 'pregrasp'" in " ".join(result.output.split())


def test_bad_input_changes_nothing(grasps: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("hello")
    assert "no known format" in run("import", tmp_path / "notes.txt", tmp_path / "back", error=InterchangeError)
    assert "format is 'tar'" in run("export", grasps, tmp_path / "out", "-f", "tar", error=InterchangeError)
    assert "something at" in run("export", grasps, tmp_path / "notes.txt", "-f", "hdf5", error=InterchangeError)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["grasps", "notes.txt"]
