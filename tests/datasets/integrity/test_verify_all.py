"""Damage to any stored file is found and named, or changes nothing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tests.support.damage import KINDS, WAYS, Bench
from tests.support.factories import make_attempt, make_header, record

from handsight.cli.app import run
from handsight.datasets import AllReport, GraspRepository, Outcome, create_branch, expire, verify_all

HEADER = make_header()
MUTATIONS = 21


@pytest.fixture
def grasps(repository: GraspRepository) -> GraspRepository:
    """A session on main, a release, and a branch that begins there."""
    attempts = [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(6)]
    record(repository, HEADER, attempts, every=3)
    repository.release("v1")
    create_branch(repository, "work", "v1")
    return repository


def found(repository: GraspRepository) -> AllReport:
    return verify_all(repository.folder)


@pytest.mark.no_cover
def test_damage_to_any_file_is_found_or_changes_nothing(tmp_path: Path) -> None:
    """``make damage`` does as many as are wanted."""
    bench = Bench(tmp_path)
    done = [bench.attempt(0, index * len(WAYS)) for index in range(MUTATIONS)]
    assert [one for one in done if one.outcome not in ("found", "harmless")] == []
    assert {one.kind for one in done} == set(KINDS)
    assert sum(one.outcome == "found" for one in done) > MUTATIONS / 2


def test_a_whole_dataset_is_verified(grasps: GraspRepository) -> None:
    report = found(grasps)
    assert report.ok
    assert (report.versions, report.checked) == (("main", "work", "v1"), 6)
    assert report.snapshots > len(grasps.log())


def test_what_versions_share_is_read_once_and_named_for_each(grasps: GraspRepository) -> None:
    chunk = max((grasps.folder / "chunks").iterdir(), key=lambda path: path.stat().st_size)
    chunk.write_bytes(bytes(chunk.stat().st_size))
    report = found(grasps)
    assert report.checked == 6
    assert set(report.damaged_in.values()) == {("main", "work", "v1")}
    assert f"chunks/{chunk.name}" in [one.file for one in report.files]


@pytest.mark.parametrize("folder", ["snapshots", "transactions"])
def test_a_lost_file_of_an_ancestor_is_named_with_what_needs_it(grasps: GraspRepository, folder: str) -> None:
    name = grasps.log()[1].snapshot_id
    (grasps.folder / folder / name).unlink()
    damage = {one.file: one.needed_by for one in found(grasps).files}
    assert damage[f"{folder}/{name}"] == ("main", "v1", "work")


def test_a_lost_manifest_that_only_an_ancestor_needs_is_named(grasps: GraspRepository) -> None:
    inspected = [grasps.icechunk_repository.inspect_snapshot(one.snapshot_id) for one in grasps.log()]
    tip, *_, older, _ = ({one["id"] for one in json.loads(text)["manifests"]} for text in inspected)
    lost = min(older - tip)
    (grasps.folder / "manifests" / lost).unlink()
    (damage,) = found(grasps).files
    assert damage.file == f"manifests/{lost}"
    assert damage.needed_by == ("main", "v1", "work")


def test_branches_whose_files_changed_places_are_named(grasps: GraspRepository) -> None:
    record(grasps, make_header(seed=2), [make_attempt(HEADER, 0)])
    refs = [grasps.folder / f"refs/branch.{name}/ref.json" for name in ("main", "work")]
    first, second = (ref.read_bytes() for ref in refs)
    refs[0].write_bytes(second)
    refs[1].write_bytes(first)
    (lost,) = found(grasps).lost_refs
    assert "branch 'work'" in lost
    assert "committed to 'main'" in lost


def test_commits_that_expired_are_no_damage(grasps: GraspRepository) -> None:
    newest = grasps.log()[0].written_at
    assert expire(grasps, newest, dry_run=False).snapshots
    assert found(GraspRepository.open(grasps.folder)).ok


@pytest.mark.parametrize("file", ["config.yaml", "refs/branch.main/ref.json"])
def test_a_dataset_that_cannot_be_opened_is_still_looked_at(
    grasps: GraspRepository, file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (grasps.folder / file).unlink()
    assert run(["dataset", "verify", str(grasps.folder), "--all"]) == 1
    assert f"{file}" in capsys.readouterr().out


def test_all_versions_and_one_are_not_asked_for_together(
    grasps: GraspRepository, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["dataset", "verify", f"{grasps.folder}@v1", "--all"]) == 2
    assert "leave out @v1" in capsys.readouterr().err
