"""Runs are found wherever they lie, and one that is damaged hides no other."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from tests.support.run_mutations import mutate_run
from tests.support.runs import save_untrained

from handsight.training.errors import CheckpointError
from handsight.training.run_folder import RUN_RECORD
from handsight.training.run_list import DEEPEST, list_runs


def names(*folders: Path) -> list[str]:
    return sorted(Path(one.run).name for one in list_runs(folders))


def test_runs_are_found_below_a_folder_and_each_once(tmp_path: Path) -> None:
    for place in ("a", "x/b", "x/y/c", "a/inside", ".hidden/d", "grasps/chunks/e"):
        save_untrained(tmp_path / place, seed=0) if place != "a/inside" else (tmp_path / place).mkdir()
    (tmp_path / "grasps" / "refs").mkdir()  # A dataset may have millions of files.
    (tmp_path / "x" / "again").symlink_to(tmp_path / "a")
    assert names(tmp_path) == ["a", "b", "c"]
    assert names(tmp_path, tmp_path / "x", tmp_path / "x" / "y" / "c") == ["a", "b", "c"]
    assert names(tmp_path / "x") == ["b", "c"]
    assert [one.run for one in list_runs([tmp_path / "a"])] == [str(tmp_path / "a")]


def test_the_search_ends_somewhere(tmp_path: Path) -> None:
    deep = tmp_path.joinpath(*"abcdefgh")
    save_untrained(deep)
    assert names(tmp_path) == []
    assert names(tmp_path.joinpath(*"abcdefgh"[: 8 - DEEPEST])) == ["h"]


def test_folders_that_are_not_there_are_all_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CheckpointError, match=r"there is no folder .*nowhere, .*file: name folders"):
        list_runs([tmp_path, tmp_path / "nowhere", tmp_path / "file"])


def test_a_damaged_run_is_listed_last_with_its_reason(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        save_untrained(tmp_path / name)
    (tmp_path / "a" / RUN_RECORD).write_text("{")
    (tmp_path / "b" / RUN_RECORD).unlink()
    (tmp_path / "b" / RUN_RECORD).symlink_to(tmp_path / "c" / RUN_RECORD)
    listed = list_runs([tmp_path])
    assert [Path(one.run).name for one in listed] == ["b", "c", "a"]
    assert listed[2].figures is None
    assert "run.json is damaged (it is no JSON" in str(listed[2].fault)
    assert all(one.fault is None for one in listed[:2])


def test_what_may_not_be_read_is_no_reason_to_stop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_untrained(tmp_path / "a")
    (tmp_path / "closed").mkdir()
    scan = os.scandir

    def refuses(path: Path) -> object:
        if path == tmp_path / "closed":
            raise PermissionError(13, "Permission denied")  # Not by its mode: root reads everything.
        return scan(path)

    monkeypatch.setattr("handsight.training.run_list.os.scandir", refuses)
    assert names(tmp_path) == ["a"]


def test_whatever_is_done_to_a_run_the_others_are_listed(tmp_path: Path) -> None:
    save_untrained(tmp_path / "whole")
    for seed in range(60):
        folder = tmp_path / f"{seed}"
        save_untrained(folder)
        mutate_run(folder, np.random.default_rng([2, seed]))
    listed = list_runs([tmp_path])
    assert len(listed) == 61
    assert str(tmp_path / "whole") in [one.run for one in listed if one.fault is None]
    assert any(one.fault for one in listed)
    assert all((one.fault is None) != (one.figures is None) for one in listed)
    assert all("\n" not in str(one.fault) for one in listed)
