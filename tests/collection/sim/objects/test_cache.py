"""Where object sets are kept: one folder, whole or absent, whoever else writes there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from handsight.collection.errors import ObjectSetError
from handsight.collection.sim.objects.cache import CACHE_VARIABLE, cache_root, publish
from handsight.collection.sim.objects.household.generate import household_folder
from handsight.collection.sim.objects.manifest import MANIFEST_FILE


def test_the_cache_is_where_the_variable_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "mine"))
    assert cache_root() == tmp_path / "mine" / "objects"
    folder = household_folder()
    assert folder.parent == cache_root()
    made_ns = (folder / MANIFEST_FILE).stat().st_mtime_ns
    assert household_folder() == folder
    assert (folder / MANIFEST_FILE).stat().st_mtime_ns == made_ns


def test_processes_may_race_for_the_cache(tmp_path: Path) -> None:
    environment = os.environ | {CACHE_VARIABLE: str(tmp_path)}
    program = (
        "from handsight.collection.sim.objects.catalogue import load_object_set\n"
        "print(len(load_object_set('household-train')))"
    )
    command = [sys.executable, "-c", program]
    workers = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    assert [worker.communicate()[0] for worker in workers] == ["30\n"] * 3
    # One set, and nothing half-written beside it.
    assert len(list((tmp_path / "objects").iterdir())) == 1


def test_a_failed_generation_leaves_nothing(tmp_path: Path) -> None:
    def fail(scratch: Path) -> None:
        (scratch / "half").write_text("")
        raise RuntimeError

    with pytest.raises(RuntimeError):
        publish(tmp_path / "set", fail)
    assert list(tmp_path.iterdir()) == []


def test_a_cache_that_cannot_be_written_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    with pytest.raises(ObjectSetError, match=f"cannot write object set .*set {CACHE_VARIABLE} to another one"):
        household_folder()


@pytest.mark.parametrize("umask", [0o002, 0o022])
def test_a_set_follows_the_umask(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        assert publish(tmp_path / "set", lambda folder: (folder / "a.urdf").touch())
        made = {path.name: path.stat().st_mode & 0o777 for path in (tmp_path / "set", tmp_path / "set" / "a.urdf")}
    finally:
        os.umask(before)
    assert made == {"set": 0o777 & ~umask, "a.urdf": 0o666 & ~umask}
