"""Every command answers programs, and every one that takes something away can be tried first."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from tests.support.command_tree import COMMANDS, option_names
from tests.support.factories import make_attempt, make_header, record
from tests.support.meshes import block, stl
from tests.support.runs import save_untrained
from tests.support.versions import grow

from handsight.cli.app import run
from handsight.datasets import GraspDataset, GraspRepository, Selection, export_dataset
from handsight.datasets.curation.curator import Curator
from handsight.datasets.curation.saved_filters import save_filter

READS = "clearance|dataset decisions|dataset diff|dataset doctor|dataset info|dataset log|dataset verify|objects ls"
DRAWS = "collect picture|dataset ls|dataset show|dataset stats|dataset suspect|heatmap|prediction|servo"
ADDS = "ablate plot|collect sim|dataset export|dataset init|dataset materialize|dataset release|evaluate"
UNTRIED = {
    **dict.fromkeys(READS.split("|"), "changes nothing"),
    **dict.fromkeys(("dataset repeat", "dataset similar"), "changes nothing"),
    **dict.fromkeys(("ablate status", "runs compare", "runs ls", "runs show"), "changes nothing"),
    **dict.fromkeys(
        (*DRAWS.split("|"), "view dataset", "view heatmap", "view trace"),
        "changes nothing but a picture or recording, which the same call makes again",
    ),
    **dict.fromkeys(("report", "view ablation"), "changes nothing but a page, which the same call makes again"),
    **dict.fromkeys(ADDS.split("|"), "adds something where nothing was, or behind what is there"),
    "review": "every decision is made by a key, and taken back by another",
    **dict.fromkeys(("collect ur10", "rig home"), "a dry run of the whole cycle is 'rig check --move'"),
    **dict.fromkeys(
        (f"rig calibrate {part}" for part in ("camera", "gripper", "payload", "reach", "table")),
        "measures, and is undone by it",
    ),
    "rig check": "changes nothing, and moves nothing unless it is asked for it",
    "rig emulate": "changes nothing: it stands in for devices until it is ended",
    "demo": "goes on in a folder of its own, and begins nothing anew that is there",
}
"""Commands without ``--dry-run``, and why they need none."""

CALLS = (
    "collect picture --out {new}.png",
    "dataset branch {data}",
    "dataset branch {data}@v1 fresh",
    "dataset branch {data} trial --delete",
    "dataset decisions {data}",
    "dataset diff {data}@v1 main",
    "dataset doctor {data}",
    "dataset exclude {data} 3 -m blurred",
    "dataset expire {data} --older-than 1s",
    "dataset export {data} {new}.zarr -f zarr",
    "dataset filter {data}",
    "dataset filter {data} fine --where success",
    "dataset filter {data} slips --where success --replace",
    "dataset filter {data} slips --delete",
    "dataset folds {data}",
    "dataset folds {data} two --by scene -k 2",
    "dataset gc {data} --older-than 0s",
    "dataset import {exported} {new}",
    "dataset import {exported} {data}",
    "dataset info {data}",
    "dataset init {new}",
    "dataset log {data}",
    "dataset ls {data}",
    "dataset ls {data} --ids",
    "dataset materialize {data}",
    "dataset merge {data} {other}",
    "dataset migrate {data} --branch newest",
    "dataset relabel {data} 2 --to failure -m slipped",
    "dataset release {data} v2 -m [bold]",
    "dataset repair {data} --branch mended",
    "dataset restore {data} 1 -m looked",
    "dataset revert {data} v1",
    "dataset score {data}",
    "dataset show {data} 2",
    "dataset stats {data}",
    "dataset undo {data}",
    "dataset verify {data}",
    "objects import {meshes} --name kitchen",
    "objects ls",
    "report {data} --out {new}.html",
    "runs compare {run} {second}",
    "runs ls {run}",
    "runs show {run}",
    "train {data} --out {new} --epochs 1",
)
LONG = {
    "ablate plot",
    "ablate run",
    "ablate status",
    "clearance",
    "crossval",
    "collect sim",
    "dataset repeat",
    "dataset similar",
    "dataset suspect",
    "demo",
    "evaluate",
    "heatmap",
    "prediction",
    "review",
    "collect ur10",
    "rig calibrate camera",
    "rig calibrate gripper",
    "rig calibrate payload",
    "rig calibrate reach",
    "rig calibrate table",
    "rig check",
    "rig emulate",
    "rig home",
    "servo",
    "tune",
    "view ablation",
    "view dataset",
    "view heatmap",
    "view trace",
}
"""Their JSON is read by tests of their own."""

REFUSED = (
    "ablate run {nowhere} --out {new}",
    "ablate status {nowhere}",
    "ablate plot {nowhere}",
    "crossval {nowhere} --out {new}",
    "clearance --model {nowhere}",
    "collect picture --out {nowhere}/x.png",
    "collect sim {nowhere}@v1 -n 1",
    "collect sim /proc/grasps -n 1",
    "dataset branch {nowhere}",
    "dataset branch {data} trial",
    "dataset decisions {nowhere}",
    "dataset diff {data} v9",
    "dataset doctor {nowhere}",
    "dataset exclude {data} 99 -m x",
    "dataset expire {data} --older-than 3x",
    "dataset export {data} {data}/x -f zarr",
    "dataset filter {data} none --delete",
    "dataset folds {data} none",
    "dataset gc {nowhere}",
    "dataset import {nowhere} {new}",
    "dataset info {data}@v9",
    "dataset init {data}",
    "dataset log {nowhere}",
    "dataset ls {data} --where nonsense",
    "dataset materialize {nowhere}",
    "dataset merge {nowhere} {data}",
    "dataset migrate {nowhere} --branch x",
    "dataset relabel {data} 99 --to failure -m x",
    "dataset release {data} v1",
    "dataset repair {nowhere} --branch x",
    "dataset restore {data} 99 -m x",
    "dataset revert {data} v9",
    "dataset show {data} 99",
    "dataset stats {data} --plot {nowhere}/x.png",
    "dataset suspect {data} --rrd {nowhere}/x.rrd",
    "dataset undo {data} 99",
    "dataset verify {nowhere}",
    "demo --out {file}",
    "evaluate --model {nowhere}",
    "dataset score {data} --replace",
    "dataset score {data} fine",
    "dataset score {data} fine --delete",
    "dataset repeat {nowhere}",
    "dataset similar {nowhere} 1 --model {nowhere}",
    "heatmap {data} --model {nowhere}",
    "report {nowhere}",
    "report {data} --out {nowhere}/x.html",
    "review {nowhere}",
    "review {data}@v1 --no-viewer",
    "view ablation {nowhere}",
    "view ablation {data}",
    "view dataset {nowhere}",
    "view heatmap {data} --model {nowhere}",
    "view heatmap {nowhere} --model {run}",
    "view trace {nowhere} --picture {new}.png",
    "view trace {file} --picture {new}.png",
    "servo --model {run} --live-url nonsense",
    "heatmap {data} 1 --wrong --model {run}",
    "view dataset {data} --picture {nowhere}/x.png",
    "objects import {nowhere} --name x",
    "prediction --model {nowhere}",
    "collect ur10 {new} --rig {nowhere}",
    "rig calibrate camera --rig {nowhere}",
    "rig calibrate gripper --rig {nowhere}",
    "rig calibrate payload --rig {nowhere}",
    "rig calibrate reach --rig {nowhere}",
    "rig calibrate table --rig {nowhere}",
    "rig check --rig {nowhere}",
    "rig emulate --rig {nowhere}",
    "rig home --rig {nowhere}",
    "runs compare {nowhere} {nowhere}",
    "runs ls {nowhere}",
    "runs show {nowhere}",
    "servo --model {nowhere}",
    "train {data} --out {file}",
    "tune {nowhere} --out {new}",
)


def command_of(call: str) -> str:
    return next(name for name in COMMANDS if f"{call} ".startswith(f"{name} "))


TRIED = tuple(call for call in CALLS if "--dry-run" in option_names(command_of(call)))


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset that has everything which can be taken away, another, an export of it, and meshes."""
    folder = tmp_path_factory.mktemp("every")
    repository = GraspRepository.create(folder / "data")
    grow(repository, to=4)
    repository.release("v1")
    curator = Curator(repository, author="anna")
    curator.exclude(Selection(where="number == 1"), "blurred")
    save_filter(repository, "slips", "not success", author="anna")
    grow(repository, to=6)
    assert run(["dataset", "branch", str(folder / "data"), "trial"]) == 0
    header = make_header(seed=2)
    record(GraspRepository.create(folder / "other"), header, [make_attempt(header, 0)])
    export_dataset(GraspDataset.open(str(folder / "data")), folder / "exported.hdf5", format="hdf5")
    (folder / "meshes").mkdir()
    (folder / "meshes" / "box.stl").write_bytes(stl(block()))
    (folder / "file").write_text("in the way")
    save_untrained(folder / "run")
    save_untrained(folder / "second", seed=1)
    return folder


@pytest.fixture
def folder(prepared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same for one test, with a cache of its own."""
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    return Path(shutil.copytree(prepared, tmp_path / "every"))


def words(call: str, folder: Path) -> list[str]:
    names = {name: folder / name for name in ("data", "other", "meshes", "file", "new", "nowhere", "run", "second")}
    return [word.format(**names, exported=folder / "exported.hdf5") for word in call.split()]


def contents(folder: Path) -> dict[Path, bytes | None]:
    """Every file and folder below one, byte for byte."""
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_prints_json(name: str) -> None:
    assert "--json" in option_names(name)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_can_be_tried_or_needs_it_not(name: str) -> None:
    assert ("--dry-run" in option_names(name)) != (name in UNTRIED)


def test_every_command_is_called_here() -> None:
    assert {command_of(call) for call in CALLS} == set(COMMANDS) - LONG
    assert {command_of(call) for call in REFUSED} == set(COMMANDS) - {"objects ls"}


@pytest.mark.parametrize("call", CALLS)
def test_json_is_one_document_and_nothing_else(call: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*words(call, folder), "--json"]) in ((0, 1) if "doctor" in call else (0,))
    json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("call", REFUSED)
def test_a_refusal_is_one_line_for_programs_too(call: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(folder)
    assert run([*words(call, folder), "--json"]) == 2
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert line.startswith("error: ")
    assert captured.out == ""
    assert contents(folder) == before


@pytest.mark.parametrize("call", TRIED)
def test_a_trial_changes_nothing(call: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(folder)
    assert run([*words(call, folder), "--dry-run", "--json"]) == 0
    json.loads(capsys.readouterr().out)
    assert contents(folder) == before
    assert run([*words(call, folder), "--dry-run"]) == 0
    assert capsys.readouterr().out
    assert contents(folder) == before
    assert run(words(call, folder)) == 0  # What was tried can be done.
