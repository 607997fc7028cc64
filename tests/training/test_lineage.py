"""From a version to the runs that were trained on it, and back."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from tests.support.runs import ORIGIN, save_untrained
from tests.support.small_disk import files_of_at_most
from tests.support.versions import grow

from handsight.datasets import GraspDataset, GraspRepository
from handsight.training.lineage import note_run, runs_trained_on
from handsight.training.run import DataOrigin
from handsight.training.run_folder import RUN_RECORD, WEIGHTS


@pytest.fixture
def grasps(tmp_path: Path) -> GraspRepository:
    repository = GraspRepository.create(tmp_path / "grasps")
    grow(repository, to=2)
    repository.release("v1")
    grow(repository, to=4)
    return repository


def origin(name: str, dataset: GraspDataset, view: str = "overhead") -> DataOrigin:
    return replace(ORIGIN, dataset=name, ref=dataset.ref, snapshot=dataset.snapshot_id, view=view)


def save_and_note(folder: Path, datasets: dict[str, GraspDataset], *, seed: int = 0, overwrite: bool = False) -> None:
    origins = tuple(origin(name, one, view) for name, one in datasets.items() for view in ("overhead", "pregrasp"))
    save_untrained(folder, seed=seed, origins=origins, overwrite=overwrite)
    note_run(folder, datasets)


def test_a_version_names_the_runs_that_were_trained_on_it(grasps: GraspRepository, tmp_path: Path) -> None:
    old, new = GraspDataset(grasps, ref="v1"), GraspDataset(grasps, ref="main")
    save_and_note(tmp_path / "a", {"old": old})
    save_and_note(tmp_path / "b", {"old": old, "new": new}, seed=1)
    assert sorted(one.run for one in runs_trained_on(old)) == [str(tmp_path / "a"), str(tmp_path / "b")]
    assert [one.run for one in runs_trained_on(new)] == [str(tmp_path / "b")]
    assert all(one.exists for one in runs_trained_on(old))
    # The same version by another name.
    assert len(runs_trained_on(GraspDataset(grasps, ref=old.snapshot_id))) == 2


def test_each_dataset_names_the_run_for_its_own_versions(grasps: GraspRepository, tmp_path: Path) -> None:
    other = GraspRepository.create(tmp_path / "other")
    grow(other, to=1)
    versions = {"a": GraspDataset(grasps, ref="v1"), "b": GraspDataset(other, ref="main")}
    save_and_note(tmp_path / "run", versions)
    for version in versions.values():
        (known,) = runs_trained_on(version)
        assert known.run == str(tmp_path / "run")


@pytest.mark.parametrize("fate", ["gone", "replaced", "damaged", "without weights"])
def test_a_run_that_is_not_there_any_more_is_told(grasps: GraspRepository, tmp_path: Path, fate: str) -> None:
    version, folder = GraspDataset(grasps, ref="v1"), tmp_path / "run"
    save_and_note(folder, {"v": version})
    match fate:
        case "gone":
            shutil.rmtree(folder)
        case "replaced":
            save_and_note(folder, {"v": version}, seed=1, overwrite=True)
        case "damaged":
            (folder / RUN_RECORD).write_text("{")
        case _:
            (folder / WEIGHTS).unlink()
    known = runs_trained_on(version)
    assert sorted(one.exists for one in known) == ([False, True] if fate == "replaced" else [False])


def test_that_nothing_can_be_noted_is_no_fault_of_the_run(grasps: GraspRepository, tmp_path: Path) -> None:
    version = GraspDataset(grasps, ref="v1")
    save_untrained(tmp_path / "run", origins=(origin("v", version),))
    with files_of_at_most(0):
        note_run(tmp_path / "run", {"v": version})
    assert runs_trained_on(version) == []
    note_run(tmp_path / "nowhere", {"v": version})
    note_run(tmp_path / "run", {"v": version})
    assert len(runs_trained_on(version)) == 1
