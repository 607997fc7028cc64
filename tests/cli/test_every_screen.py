"""Every command that prints for people, in four widths: whole words, literal names, nothing a shell cannot use."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from tests.support.lab import make_lab

from handsight.cli.app import run
from handsight.datasets import GraspDataset, create_branch

NAME = "[red]lab[/red]"
WIDTHS = (60, 80, 120, 200)
READING = {
    "info": "info {d}",
    "log": "log {d}",
    "log of a release": "log {d}@v1",
    "ls": "ls {d}",
    "ls where": "ls {d} --where success",
    "ls sorted": "ls {d} --sort contact_force_n -n 3",
    "ls columns": "ls {d} --columns outcome,objects,target,seed,contact_force_n,elapsed_s,pregrasp_x_m,failure",
    "show": "show {d} {first}",
    "show all": "show {d} {last} --all",
    "stats": "stats {d}",
    "branch": "branch {d}",
    "decisions": "decisions {d}",
    "filter": "filter {d}",
    "folds": "folds {d}",
    "diff": "diff {d}@v1 trial",
    "verify": "verify {d} -j 1",
    "doctor": "doctor {d}",
    "exclude dry": "exclude {d} {last} -m x --dry-run",
    "revert dry": "revert {d} v1 --dry-run",
    "gc dry": "gc {d} --dry-run",
    "expire dry": "expire {d} --older-than 1h --dry-run",
    "merge dry": "merge {d}@v1 {other} --dry-run",
}
ONE_LINE = {"verify", "exclude dry", "gc dry", "expire dry", "merge dry"}
WRITING = {
    "init": "init {new}",
    "exclude": "exclude {d} {last} -m x",
    "restore": "restore {d} {last} -m x",
    "relabel": "relabel {d} {first} --to failure -m '[b]x[/b]'",
    "undo": "undo {d}",
    "release": "release {d} v2 -m '[b]x[/b]'",
    "branch": "branch {d} other",
    "branch deleted": "branch {d} gone --delete",
    "save filter": "filter {d} more --where success",
    "revert": "revert {d} v1",
    "gc": "gc {d}",
    "expire": "expire {d} --older-than 1h",
    "repair": "repair {d} --branch repaired",
    "export": "export {d} {new}.zarr -f zarr",
    "import": "import {exported} {new}",
    "migrate": "migrate {d} --branch newest",
    "nowhere": "info {new}",
    "no ref": "info {d}@nowhere",
    "no attempt": "show {d} 99",
    "no filter": "ls {d} --filter nothing",
    "no branch": "branch {d} nothing --delete",
}
PRINTS_IT = (
    "init",
    "release",
    "export",
    "nowhere",
    "no ref",
    "no attempt",
    "no branch",
    "branch deleted",
    "exclude",
    "relabel",
)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("screens") / NAME
    folder.parent.mkdir(parents=True)
    make_lab(folder)
    make_lab(folder.parent.parent / "other")
    return folder


def said(line: str, lab: Path, capsys: pytest.CaptureFixture[str], **names: object) -> tuple[int, str]:
    ids = GraspDataset.open(str(lab)).attempts.index
    given = {"d": lab, "first": ids[0], "last": ids[-1], "other": lab.parent.parent / "other", **names}
    words = shlex.split(line.format(**{name: shlex.quote(str(value)) for name, value in given.items()}))
    capsys.readouterr()
    status = run(["dataset", *words])
    printed = capsys.readouterr()
    return status, printed.out + printed.err


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", READING)
def test_a_screen_fits(
    name: str, width: int, lab: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    status, out = said(READING[name], lab, capsys)
    assert status in (0, 1), out
    for line in out.splitlines():
        assert line == line.rstrip()
        assert "\x1b" not in line
        # A message is one line, which the terminal breaks; a digest of 64 characters is never broken.
        assert name in ONE_LINE or len(line) <= width or max(map(len, line.split())) == 64, line


@pytest.mark.parametrize("width", WIDTHS)
def test_one_line_an_attempt_and_ids_that_are_taken(
    width: int, lab: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    _, out = said("ls {d}", lab, capsys)
    rows = out.splitlines()[1:19]
    ids = GraspDataset.open(str(lab)).attempts.index.tolist()
    shown = [row.split()[0] for row in rows]
    assert shown == ids if width == 200 else all(re.fullmatch(r"[0-9A-Z]+-[0-9]+", one) for one in shown)
    for one, whole in zip(shown[:2], ids, strict=False):
        assert said(f"show {{d}} {one}", lab, capsys)[1].splitlines()[0] == whole
    assert sum(" yes " in row for row in rows) == 2  # Those that are excluded.


@pytest.mark.parametrize("width", WIDTHS)
def test_snapshots_as_shown_are_taken(
    width: int, lab: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    _, out = said("log {d}", lab, capsys)
    first = out.splitlines()[1].split()[0]
    assert said(f"info {{d}}@{first}", lab, capsys)[0] == 0


def literal(out: str) -> bool:
    """Whether what looks like markup stands as it was written."""
    rest = out.replace(NAME, "")
    for text in ("[b]cup[/b]", "[i]anna[/i]", "[bold]tripod[/]", "[b]x[/b]", "[u]week[/u]"):
        rest = rest.replace(text, "")
    return not re.search(r"\[/|lab\[|red\]|\\\[", rest)


@pytest.mark.parametrize("name", READING)
def test_names_with_brackets_are_read_as_they_are(
    name: str, lab: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    _, out = said(READING[name], lab, capsys)
    assert literal(out)
    if name in ("decisions", "ls"):
        assert {"decisions": "[i]anna[/i]", "ls": "[b]cup[/b]"}[name] in out


@pytest.mark.parametrize("name", WRITING)
def test_names_with_brackets_are_written_as_they_are(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / NAME
    path.parent.mkdir(parents=True)
    repository = make_lab(path)
    create_branch(repository, "gone")
    exported = tmp_path / "[red]e"
    if name == "import":
        said("export {d} {exported} -f zarr", path, capsys, exported=exported)
    new = tmp_path / "x" / NAME
    new.parent.mkdir(parents=True)
    status, out = said(WRITING[name], path, capsys, new=new, exported=exported)
    assert status == (2 if name.startswith("no") else 0), out
    assert literal(out.replace("[red]e", "")), out
    assert NAME in out or name not in PRINTS_IT
