"""A held file tells whether its maker is still at work, whatever becomes of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, Popen

import pytest

from handsight.datasets.held import (
    HeldFile,
    HeldFolder,
    clear_abandoned,
    is_held,
    lock_of,
    remove_abandoned,
    temporary_folder,
)

HOLDER = """
import sys
from pathlib import Path
from handsight.datasets.held import HeldFile
held = HeldFile(Path(sys.argv[1]), "mine")
print("held", flush=True)
sys.stdin.read()
"""


@contextmanager
def holder(path: Path) -> Iterator[Popen[str]]:
    """Another process that holds a file until its input ends."""
    with Popen([sys.executable, "-P", "-c", HOLDER, str(path)], stdin=PIPE, stdout=PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        try:
            yield process
        finally:
            process.kill()


def test_a_file_is_held_until_it_is_released(tmp_path: Path) -> None:
    path = tmp_path / "mine"
    held = HeldFile(path, "said")
    assert path.read_text() == "said"
    assert is_held(path)
    assert not remove_abandoned(path)
    with pytest.raises(FileExistsError):
        HeldFile(path)
    held.release()
    held.release()
    assert not path.exists()


def test_a_stopped_process_holds_its_file_and_a_killed_one_does_not(tmp_path: Path) -> None:
    path = tmp_path / "theirs"
    with holder(path) as process:
        process.send_signal(signal.SIGSTOP)
        os.waitpid(process.pid, os.WUNTRACED)
        assert is_held(path)
        assert not remove_abandoned(path)
        process.kill()
        process.wait()
        assert not is_held(path)
        assert remove_abandoned(path)
    assert list(tmp_path.iterdir()) == []


def test_a_process_that_ends_leaves_nothing(tmp_path: Path) -> None:
    with holder(tmp_path / "theirs") as process:
        process.communicate("")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("outlives_loss", [False, True])
def test_a_lost_object_holds_nothing(tmp_path: Path, outlives_loss: bool) -> None:
    path = tmp_path / "mine"
    held = HeldFile(path, outlives_loss=outlives_loss)
    del held
    assert path.exists() == outlives_loss
    assert remove_abandoned(path) == outlives_loss


def test_a_forked_child_that_ends_takes_nothing_along(tmp_path: Path) -> None:
    program = """
import os, sys
from pathlib import Path
from handsight.datasets.held import HeldFile, is_held
path = Path(sys.argv[1])
held = HeldFile(path)
child = os.fork()
if child == 0:
    sys.exit()
os.waitpid(child, 0)
sys.exit(not is_held(path))
"""
    command = [sys.executable, "-P", "-c", program, str(tmp_path / "mine")]
    assert subprocess.run(command, check=False).returncode == 0


def test_what_is_not_there_may_be_held_elsewhere(tmp_path: Path) -> None:
    assert is_held(tmp_path / "absent")
    assert not remove_abandoned(tmp_path / "absent")


def test_only_what_nobody_holds_is_cleared(tmp_path: Path) -> None:
    for name in ("work-1", "work-2", "work-3", "other-1"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_text("")
    mine = HeldFile(lock_of(tmp_path / "work-1"))
    for name in ("work-2", "other-1"):
        lock_of(tmp_path / name).write_text("")
    clear_abandoned(tmp_path, "work-")
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"work-1", "work-1.lock", "work-3", "other-1", "other-1.lock"}, "work-3 may be somebody's"
    mine.release()


def test_a_temporary_folder_goes_with_its_maker_or_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    program = """
import os, signal
from handsight.datasets.held import HeldFolder
folder = HeldFolder("handsight-test-")
(folder.path / "file").write_text("")
os.kill(os.getpid(), signal.SIGKILL)
"""
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    subprocess.run([sys.executable, "-P", "-c", program], env=environment, check=False)
    assert len(list(tmp_path.iterdir())) == 2
    with HeldFolder("handsight-test-") as mine:
        assert mine.stat().st_mode & 0o777 == 0o700
        (mine / "file").write_text("")
        assert sorted(tmp_path.iterdir()) == [mine, lock_of(mine)]
    assert list(tmp_path.iterdir()) == []


def test_the_temporary_folder_is_chosen_without_a_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python's own choice writes a file and deletes it: a kill between both leaves it (found by 1,000 kills)."""
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "gettempdir", lambda: pytest.fail("asked for Python's choice"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    assert temporary_folder() == tmp_path
    monkeypatch.setenv("TMPDIR", str(tmp_path / "missing"))
    monkeypatch.setenv("TEMP", str(tmp_path))
    assert temporary_folder() == tmp_path
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path / "chosen"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "chosen"))
    assert temporary_folder() == tmp_path / "chosen"
