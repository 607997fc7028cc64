"""What a command imports, in a fresh interpreter: a refusal next to nothing, a listing no PyTorch."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.runs import save_untrained

from handsight.datasets import GraspRepository

HEAVY = (
    "torch",
    "icechunk",
    "zarr",
    "pandas",
    "rerun",
    "matplotlib",
    "cv2",
    "pybullet",
    "ray",
    "numpy",
    "rich",
    "optuna",
)

PROGRAM = """
import sys
from handsight.cli.app import run
status = run(sys.argv[1:])
print("LOADED", status, *sys.modules)
"""
SMALLEST = """
import sys
import typer
def command(dataset: str, as_json: bool = False) -> None:
    print("LOADED", 0, *sys.modules)
typer.run(command)
"""
"""A command of Typer with one argument and one option; below this no command of ours can be."""


def loaded(program: str, *words: object) -> tuple[int, set[str], str]:
    """Exit status of a call, the modules it leaves imported, and its complaints."""
    call = [sys.executable, "-P", "-c", program, *map(str, words)]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    marked = [line for line in done.stdout.splitlines() if line.startswith("LOADED ")]
    assert marked, done.stderr
    _, status, *modules = marked[0].split()
    return int(status), set(modules), done.stderr


@pytest.fixture(scope="module")
def smallest() -> int:
    """How many modules the smallest command has."""
    _, modules, _ = loaded(SMALLEST, "x")
    return len(modules)


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    repository = GraspRepository.create(tmp_path_factory.mktemp("cost") / "grasps")
    header = make_header(width=16, height=12)
    record(repository, header, [make_attempt(header, number) for number in range(4)])
    return Path(str(repository.path))


REFUSED = {
    "typo": ("datset", "Did you mean 'dataset'?"),
    "typo behind a noun": ("dataset inof {no}", "Did you mean 'info'?"),
    "dataset info": ("dataset info {no}", "there is no dataset"),
    "dataset info of a folder": ("dataset info {folder}", "no dataset, expected a dataset folder"),
    "dataset ls": ("dataset ls {no}", "there is no dataset"),
    "dataset show": ("dataset show {no} 1", "there is no dataset"),
    "dataset exclude": ("dataset exclude {no} 1 -m x", "there is no dataset"),
    "dataset folds": ("dataset folds {no} cv --by object", "there is no dataset"),
    "dataset verify": ("dataset verify {no}", "there is no dataset"),
    "dataset gc": ("dataset gc {no}", "there is no dataset"),
    "dataset diff": ("dataset diff {no} main", "there is no dataset"),
    "dataset export": ("dataset export {no} {no}.h5 -f hdf5", "there is no dataset"),
    "dataset merge": ("dataset merge {no} {no}2", "there is no dataset"),
    "dataset suspect": ("dataset suspect {no}", "there is no dataset"),
    "dataset materialize": ("dataset materialize {no}", "there is no dataset"),
    "an address that is none": ("dataset info {no}@", "ends in '@'"),
    "train": ("train {no} --out {folder}/run", "there is no dataset"),
    "train into a full folder": ("train {grasps} --out {grasps}", "holds other files"),
    "tune": ("tune {no} --out {folder}/tune", "there is no dataset"),
    "runs ls": ("runs ls {no}", "there is no folder"),
    "runs show": ("runs show {no}", "is no folder"),
    "runs compare": ("runs compare {no} {no}", "is no folder"),
    "runs compare one": ("runs compare {no}", "expected two or more"),
    "evaluate": ("evaluate --model {no}", "is no folder"),
    "evaluate a folder": ("evaluate --model {grasps}", "holds no finished run"),
    "dataset score": ("dataset score {no} fine --model {no}", "there is no dataset"),
    "dataset score in no way": ("dataset score {grasps} fine", "expected one of --model"),
    "dataset repeat": ("dataset repeat {no}", "there is no dataset"),
    "dataset similar": ("dataset similar {no} 1 --model {no}", "there is no dataset"),
    "view dataset": ("view dataset {no}", "there is no dataset"),
    "view dataset in two ways": ("view dataset {grasps} --web --picture x.png", "expected one of them"),
    "view heatmap": ("view heatmap {no} --model {no}", "there is no dataset"),
    "view heatmap without a run": ("view heatmap {grasps} --model {no}", "is no folder"),
    "view trace": ("view trace {no}.rrd", "there is no recording"),
    "heatmap in two ways": ("heatmap {grasps} 1 --wrong --model {no}", "is no folder"),
    "view ablation": ("view ablation {no}", "is no folder"),
    "view ablation of a dataset": ("view ablation {grasps}", "holds no sweep"),
    "report": ("report {no}", "there is no dataset"),
    "report into no folder": ("report {grasps} --out {no}/x.html", "there is no folder"),
    "evaluate into a file": ("evaluate --model {no} --figures {no}", "is no folder"),
    "review": ("review {no}", "there is no dataset"),
    "review without a network": ("review {grasps} --like 3", "add --model RUN"),
    "heatmap": ("heatmap {no} --model {no}", "there is no dataset"),
    "heatmap without a run": ("heatmap {grasps} --model {no}", "is no folder"),
    "prediction": ("prediction --model {no}", "is no folder"),
    "clearance": ("clearance --model {no}", "is no folder"),
    "servo": ("servo --model {no}", "is no folder"),
    "collect by a network": ("collect sim {no} --policy servo", "--model RUN"),
    "collect by a network that is not there": ("collect sim {no} --policy servo --model {no}", "is no folder"),
    "collect by chance with a network": ("collect sim {no} --model {no}", "--model goes with"),
    "collect on no cluster": ("collect sim {no} --ray-address host:1", "--ray-address host:1 goes with"),
    "evaluate on no cluster": ("evaluate --model {no} --ray-address host:1", "--ray-address host:1 goes with"),
    "collect ur10": ("collect ur10 {no} --rig {no}", "is no file"),
    "evaluate on a rig that is not there": ("evaluate --model {no} --station ur10", "is no folder"),
    "rig check": ("rig check --rig {no}", "is no file"),
    "rig calibrate": ("rig calibrate camera --rig {no}", "is no file"),
    "rig home": ("rig home --rig {no}", "is no file"),
    "rig emulate": ("rig emulate --rig {no}", "is no file"),
    "picture": ("collect picture --out {no}.jpg", "ends in .png"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_refusal_imports_next_to_nothing(name: str, grasps: Path, tmp_path: Path, smallest: int) -> None:
    words, said = REFUSED[name]
    named = {"no": tmp_path / "nowhere", "folder": tmp_path, "grasps": grasps}
    status, modules, complaint = loaded(PROGRAM, *(word.format(**named) for word in words.split()))
    assert status == 2
    assert said in complaint
    assert modules & set(HEAVY) == set()
    assert len(modules) <= smallest + 66, sorted(modules)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("collect sim {new} -n -4", "attempts is -4"),
        ("collect sim {new} --vary colours", "vary is 'colours'"),
        ("collect sim {new} --objects blorks", "unknown object set"),
    ],
)
def test_what_only_the_simulator_can_refuse_needs_no_dataset(words: str, said: str, tmp_path: Path) -> None:
    status, modules, complaint = loaded(PROGRAM, *(word.format(new=tmp_path / "new") for word in words.split()))
    assert status == 2
    assert said in complaint
    assert modules & {"torch", "icechunk", "zarr", "pandas", "rerun", "matplotlib", "rich"} == set()


@pytest.mark.parametrize(
    "words",
    ["--help", "dataset --help", "dataset ls --help", "train --help", "tune --help", "runs -h", "collect sim -h"],
)
def test_help_imports_next_to_nothing(words: str, smallest: int) -> None:
    status, modules, _ = loaded(PROGRAM, *words.split())
    assert status == 0
    assert modules & set(HEAVY) == set()
    assert len(modules) <= smallest + 66, sorted(modules)


@pytest.mark.parametrize(
    "words",
    [
        "info {d}",
        "ls {d}",
        "ls {d} --where success --json",
        "log {d}",
        "show {d} 2",
        "stats {d}",
        "decisions {d}",
        "filter {d}",
        "folds {d}",
        "branch {d}",
        "diff {d} main",
        "verify {d} -j 1",
        "exclude {d} 2 -m x --dry-run",
        "gc {d} --dry-run",
        "export {d} {d}.zarr -f zarr",
    ],
)
def test_commands_for_datasets_import_no_network_and_no_viewer(words: str, grasps: Path) -> None:
    status, modules, complaint = loaded(PROGRAM, "dataset", *(word.format(d=grasps) for word in words.split()))
    assert status == 0, complaint
    assert "icechunk" in modules
    assert modules & {"torch", "rerun", "matplotlib", "pybullet", "ray"} == set()
    assert "scipy" not in modules


@pytest.mark.parametrize("words", ["stats {d} --plot {d}.png", "show {d} 2 --picture {d}-2.png", "doctor {d} --deep"])
def test_what_draws_or_looks_at_a_dataset_imports_no_network(words: str, grasps: Path) -> None:
    status, modules, complaint = loaded(PROGRAM, "dataset", *(word.format(d=grasps) for word in words.split()))
    assert status in (0, 1), complaint
    assert modules & {"torch", "rerun", "pybullet", "ray"} == set()


@pytest.mark.parametrize("words", ["ls {folder}", "ls {folder} --json", "show {run}", "compare {run} {run}"])
def test_runs_are_looked_at_without_their_networks(words: str, tmp_path: Path) -> None:
    save_untrained(tmp_path / "run")
    named = {"folder": tmp_path, "run": tmp_path / "run"}
    status, modules, complaint = loaded(PROGRAM, "runs", *(word.format(**named) for word in words.split()))
    assert status == 0, complaint
    assert modules & set(HEAVY) <= {"rich"}
