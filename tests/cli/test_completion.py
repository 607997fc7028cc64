"""Shell completion, by the protocol that the shells speak: environment in, candidates out."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from handsight.cli.app import NOUNS
from handsight.cli.dataset.app import COMMANDS

PROGRAM = "import sys; from handsight.cli.app import main; main()"


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
    assert completed("handsight dataset re") == ["release", "revert", "restore", "relabel", "repair"]
    assert completed("handsight collect ") == ["sim", "picture"]


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
