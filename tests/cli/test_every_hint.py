"""Calls that the program tells its user to make: each is run as it stands, in a shell's words, and works."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.support.lab import make_lab

from handsight.cli.app import run
from handsight.datasets import create_branch

NAMES = ("lab", "my lab", "[red]lab", "it's", "l$HOME")


def hints(out: str) -> Iterator[list[str]]:
    """The calls in a message: in quotation marks, or bare to the end of the line."""
    for line in out.splitlines():
        for quoted, bare in re.findall(r"'(handsight [^']+)'(?!\w)|(?<!')(handsight .*)$", line):
            yield shlex.split(quoted or bare)


def printed(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    capsys.readouterr()
    run([str(word) for word in words])
    caught = capsys.readouterr()
    return caught.out + caught.err


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "words",
    [
        "exclude {d} --where 'number == 0' -m x",
        "relabel {d}@trial --where 'number == 0' --to failure -m x",
        "restore {d} --where 'number == 1' -m x",
        "branch {d} gone --delete",
        "show {d} 99",
        "show {d}@trial 99",
        "info {new}",
        "merge {d} {other} --session 01M8ASKA32CHGZZDFRGCA8YCM2",
    ],
)
def test_a_hint_works_as_it_is_printed(
    words: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    create_branch(make_lab(Path(name)), "gone")
    make_lab(Path("other"))
    named = {"d": shlex.quote(name), "new": shlex.quote(f"{name} new"), "other": "other"}
    told = list(hints(printed(capsys, "dataset", *shlex.split(words.format(**named)))))
    assert len(told) == 1
    (call,) = told
    assert any(name in word for word in call)
    assert run(call[1:]) == 0, call


def test_the_hint_after_an_edit_undoes_it_on_its_branch(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "my lab"
    make_lab(path)
    (undo,) = hints(printed(capsys, "dataset", "exclude", f"{path}@trial", "--where", "number == 0", "-m", "x"))
    assert undo[1:4] == ["dataset", "undo", f"{path}@trial"]
    assert run(undo[1:]) == 0
    assert "(undone)" in printed(capsys, "dataset", "decisions", f"{path}@trial")
    assert "(undone)" not in printed(capsys, "dataset", "decisions", path)
