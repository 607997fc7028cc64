"""Shell completion, by the protocol that the shells speak: environment in, candidates out."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.support.lab import make_lab
from tests.support.measured_children import measured_children

from handsight.cli.app import NOUNS
from handsight.cli.completion import rejoined
from handsight.cli.dataset.app import COMMANDS
from handsight.collection.sim.config import RANDOMIZED
from handsight.collection.sim.objects.catalogue import OBJECT_SETS
from handsight.datasets import EXPORT_FORMATS, FORMATS, GraspDataset
from handsight.datasets.reading.attempt_ids import resolve_attempt_ids
from handsight.evaluation.disturbance import EXAMPLES
from handsight.servoing.methods.registry import METHODS

PROGRAM = "import sys; from handsight.cli.app import main; main()"


@pytest.fixture(scope="module", autouse=True)
def measured() -> Iterator[None]:
    with measured_children():
        yield


def call(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The executable in a process of its own."""
    return subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM, *words],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )


def completed(line: str) -> list[str]:
    """What bash offers at the end of a line."""
    words = line.split(" ")
    done = call(_HANDSIGHT_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words) - 1))
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_nouns() -> None:
    assert completed("handsight ") == [noun.name for noun in NOUNS]
    assert completed("handsight da") == ["dataset"]


def test_verbs() -> None:
    assert completed("handsight dataset ") == [command.name for command in COMMANDS]
    assert completed("handsight dataset re") == ["release", "revert", "restore", "relabel", "repeat", "repair"]
    assert completed("handsight collect ") == ["sim", "ur10", "picture"]


def test_options_and_their_values() -> None:
    assert {"--where", "--filter", "--sort", "--json", "--help"} <= set(completed("handsight dataset ls --"))
    assert completed("handsight dataset ls --wh") == ["--where"]
    assert completed("handsight train x --channels ") == ["rgbd", "rgb", "depth"]
    assert "--version" in completed("handsight --")


def test_zsh_and_fish_are_given_the_lines_too() -> None:
    zsh = call(_HANDSIGHT_COMPLETE="complete_zsh", _TYPER_COMPLETE_ARGS="handsight dataset inf")
    assert '"info":"Summarise a version' in zsh.stdout
    fish = call(
        _HANDSIGHT_COMPLETE="complete_fish",
        _TYPER_COMPLETE_ARGS="handsight dataset inf",
        _TYPER_COMPLETE_FISH_ACTION="get-args",
    )
    assert fish.stdout.startswith("info\tSummarise a version")


@pytest.mark.parametrize(
    ("shell", "sign"),
    [("bash", "complete -o default -F"), ("zsh", "#compdef handsight"), ("fish", "complete --command handsight")],
)
def test_the_script_of_a_shell_is_printed(shell: str, sign: str) -> None:
    done = call("--show-completion", shell)
    assert done.returncode == 0, done.stderr
    assert sign in done.stdout
    assert f"complete_{shell}" in done.stdout


def test_it_is_installed_for_the_shell_that_asks(tmp_path: Path) -> None:
    # The shell is found among the parents of the process, so one has to be the parent.
    line = f"{sys.executable} -P -c '{PROGRAM}' --install-completion; exit $?"
    environment = {**os.environ, "HOME": str(tmp_path)}
    done = subprocess.run(["bash", "--norc", "-c", line], capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    installed = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert any("complete_bash" in path.read_text() for path in installed)
    assert (tmp_path / ".bashrc").exists()


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lab")
    make_lab(folder / "lab")
    (folder / "runs").mkdir()
    return folder / "lab"


def test_datasets_and_their_versions(lab: Path) -> None:
    assert completed(f"handsight dataset ls {lab.parent}/l") == [str(lab)]
    assert completed(f"handsight dataset ls {lab}@") == [f"{lab}@v1", f"{lab}@main", f"{lab}@trial"]
    assert completed(f"handsight dataset exclude {lab}@t") == [f"{lab}@trial"]
    assert completed(f"handsight dataset exclude {lab}@v") == []


def test_runs(tmp_path: Path) -> None:
    for name in ("runs/a", "runs/another"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "run.json").write_text("{}")
    (tmp_path / "runs" / ".hidden").mkdir()
    assert completed(f"handsight runs show {tmp_path}/r") == [f"{tmp_path}/runs/"]
    assert completed(f"handsight runs compare {tmp_path}/runs/a {tmp_path}/runs/an") == [f"{tmp_path}/runs/another"]
    assert completed(f"handsight runs show {tmp_path}/runs/") == [f"{tmp_path}/runs/a", f"{tmp_path}/runs/another"]


def test_names_within_a_dataset(lab: Path) -> None:
    ids = GraspDataset.open(str(lab)).attempts.index
    assert completed(f"handsight dataset ls {lab} --filter ") == ["slips"]
    assert completed(f"handsight dataset ls {lab} --columns number,width_f") == ["number,width_final_m"]
    assert completed(f"handsight dataset folds {lab} c") == ["cv2"]
    assert completed(f"handsight dataset revert {lab} ") == ["v1", "main", "trial"]
    assert completed(f"handsight dataset show {lab} {ids[0][:20]}")[:1] in ([ids[0]], [ids[12]])
    for short in completed(f"handsight dataset show {lab} {ids[0][:3]}"):
        assert resolve_attempt_ids(GraspDataset.open(str(lab)), [short])


def test_values_of_options(lab: Path) -> None:
    assert completed("handsight servo --method ") == list(METHODS)
    assert completed("handsight evaluate --methods random,") == [
        f"random,{name}" for name in METHODS if name != "random"
    ]
    assert set(OBJECT_SETS) <= set(completed("handsight collect sim x --objects "))
    assert completed(f"handsight dataset export {lab} x -f ") == list(EXPORT_FORMATS)
    assert completed("handsight dataset import x y -f ") == [one.name for one in FORMATS]
    assert completed("handsight evaluate --disturb ") == list(EXAMPLES)
    assert completed("handsight collect sim x --vary ") == [*RANDOMIZED, "all"]


@pytest.mark.parametrize(
    "line",
    ["handsight dataset ls nowhere@", "handsight dataset ls s3://bucket/x@", "handsight dataset ls nowhere --filter "],
)
def test_where_nothing_can_be_offered_nothing_is_said(line: str) -> None:
    done = call(_HANDSIGHT_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(line.split(" ")) - 1))
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "", "")


def test_bash_is_given_the_end_that_it_replaces(lab: Path) -> None:
    """Its words end at an @, too, and it hands them over one a line."""
    words = ["handsight", "dataset", "ls", str(lab), "@", "v"]
    done = call(_HANDSIGHT_COMPLETE="complete_bash", COMP_WORDS="\n".join(words), COMP_CWORD="5")
    assert done.stdout.split() == ["@v1"]


@pytest.mark.parametrize(
    ("typed", "current", "whole", "place"),
    [
        (["ls", "lab", "@", "v"], 3, ["ls", "lab@v"], 1),
        (["ls", "lab", "@"], 2, ["ls", "lab@"], 1),
        (["ls", "lab", "@", "v1", "--filter", ""], 5, ["ls", "lab@v1", "--filter", ""], 3),
        (["ls", "lab"], 1, ["ls", "lab"], 1),
    ],
)
def test_words_of_bash_are_put_together(typed: list[str], current: int, whole: list[str], place: int) -> None:
    assert rejoined(typed, current) == (whole, place)


def test_candidates_need_no_network_and_no_simulator(lab: Path) -> None:
    line = f"handsight dataset ls {lab} --filter "
    program = f"{PROGRAM.removesuffix('main()')}from handsight.cli.app import run; run(); print('LOADED', *sys.modules)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "_HANDSIGHT_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": "5"},
    )
    offered, loaded = done.stdout.split("LOADED")
    assert offered.split() == ["slips"]
    assert set(loaded.split()) & {"torch", "pybullet", "rerun", "matplotlib", "ray"} == set()
