"""Files and folders that are there whole or not at all."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from subprocess import PIPE, Popen

import pytest

from handsight.datasets.atomic import atomic_file, atomic_folder, clear_unfinished


def test_a_file_appears_when_the_block_ends_and_not_before(tmp_path: Path) -> None:
    target = tmp_path / "table.csv"
    target.write_text("old")
    with atomic_file(target) as unfinished:
        assert unfinished.parent == tmp_path
        assert unfinished.name.startswith(".table.")
        assert unfinished.suffix == ".csv"
        unfinished.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_block_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    target = tmp_path / "table.csv"
    target.write_text("old")

    def interrupted() -> None:
        with atomic_file(target) as unfinished:
            unfinished.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    with pytest.raises(FileNotFoundError), atomic_file(target):
        pass  # Nothing was written.
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_two_that_write_the_same_file_do_not_meet(tmp_path: Path) -> None:
    target = tmp_path / "table.csv"
    with atomic_file(target) as first, atomic_file(target) as second:
        first.write_text("first")
        second.write_text("second")
    assert target.read_text() == "first"
    assert list(tmp_path.iterdir()) == [target]


def test_a_file_has_the_rights_of_any_new_one(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    with atomic_file(tmp_path / "atomic") as unfinished:
        unfinished.write_text("")
    assert (tmp_path / "atomic").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_folder_appears_when_the_block_ends_and_replaces_an_empty_one(tmp_path: Path) -> None:
    target = tmp_path / "set"
    target.mkdir()
    with atomic_folder(target) as unfinished:
        assert not unfinished.exists()
        unfinished.mkdir()
        (unfinished / "a").write_text("a")
        assert not (target / "a").exists()
    assert (target / "a").read_text() == "a"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_somebody_else_made_meanwhile_stays_theirs(tmp_path: Path) -> None:
    target = tmp_path / "set"

    def overtaken() -> None:
        with atomic_folder(target) as unfinished:
            unfinished.mkdir()
            target.mkdir()
            (target / "theirs").write_text("")

    with pytest.raises(OSError, match="not empty"):
        overtaken()
    assert [path.name for path in target.iterdir()] == ["theirs"]
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_whose_block_fails_leaves_nothing(tmp_path: Path) -> None:
    def failing() -> None:
        with atomic_folder(tmp_path / "set") as unfinished:
            unfinished.mkdir()
            (unfinished / "a").write_text("a")
            raise KeyError("a")

    with pytest.raises(KeyError):
        failing()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("durable", [False, True])
def test_what_is_to_be_durable_is_synced_before_and_after_it_is_renamed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, durable: bool
) -> None:
    synced: list[tuple[bool, bool]] = []
    target = tmp_path / "ref.json"
    fsync = os.fsync

    def follow(descriptor: int) -> None:
        fsync(descriptor)
        synced.append((os.path.samestat(os.fstat(descriptor), tmp_path.stat()), target.exists()))

    monkeypatch.setattr(os, "fsync", follow)
    with atomic_file(target, durable=durable) as unfinished:
        unfinished.write_text("{}")
    target.unlink()
    with atomic_folder(target, durable=durable) as unfinished:
        unfinished.mkdir()
    assert synced == [(False, False), (True, True)] * 2 * durable


KILLED = """
import os, signal, sys
from pathlib import Path
from handsight.datasets.atomic import atomic_file, atomic_folder
make = {"file": atomic_file, "folder": atomic_folder}[sys.argv[1]]
with make(Path(sys.argv[2])) as unfinished:
    if sys.argv[1] == "folder":
        unfinished.mkdir()
        unfinished = unfinished / "half"
    unfinished.write_text("half")
    if sys.argv[3] == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    print("at work", flush=True)
    sys.stdin.read()
"""


def written_elsewhere(kind: str, target: Path, end: str) -> Popen[str]:
    return Popen([sys.executable, "-P", "-c", KILLED, kind, str(target), end], stdin=PIPE, stdout=PIPE, text=True)


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_what_a_killed_process_was_writing_goes_with_the_next_of_its_name(tmp_path: Path, kind: str) -> None:
    target = tmp_path / "set.zarr"
    with written_elsewhere(kind, target, "kill") as killed:
        killed.communicate()
    assert len(list(tmp_path.iterdir())) == 2
    with atomic_file(target) if kind == "file" else atomic_folder(target) as unfinished:
        unfinished.write_text("whole")
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_what_another_process_is_writing_stays(tmp_path: Path, kind: str) -> None:
    target = tmp_path / "set.zarr"
    with written_elsewhere(kind, target, "wait") as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "at work\n"
        before = set(tmp_path.iterdir())
        clear_unfinished(tmp_path)
        assert set(tmp_path.iterdir()) == before
        other.kill()
        other.wait()
        clear_unfinished(tmp_path)
    assert list(tmp_path.iterdir()) == []
