"""``handsight review`` as its user meets it: keys are piped in, each decides, and each can be undone."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest
from tests.support.lab import make_lab

from handsight.cli.app import run
from handsight.datasets import GraspDataset


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return Path(str(make_lab(tmp_path / "lab").path))


def review(monkeypatch: pytest.MonkeyPatch, keys: str, *words: str) -> int:
    monkeypatch.setattr(sys, "stdin", io.StringIO(keys))
    return run(["review", "lab", "--no-viewer", *words])


def test_ten_decisions_are_taken_and_all_of_them_undone(
    lab: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = GraspDataset.open(str(lab)).attempts
    assert review(
        monkeypatch, "xxfxxxfxxx\nq", "--where", "success.notna() and success and not excluded", "--json"
    ) in (0, 2)
    capsys.readouterr()
    words = ("--where", "not excluded and outcome != 'aborted'", "--json")
    assert review(monkeypatch, "x" * 10, *words) == 0
    told = json.loads(capsys.readouterr().out)
    assert [one["action"] for one in told["decisions"]] == ["exclude"] * len(told["decisions"])
    decisions = GraspDataset.open(str(lab)).overlay
    mine = [one for one in decisions.decisions if one.reason == "reviewed"]
    for _ in mine:
        assert run(["dataset", "undo", "lab"]) == 0
    after = GraspDataset.open(str(lab)).attempts
    assert after["excluded"].equals(before["excluded"])
    assert after["success"].equals(before["success"])


def test_each_attempt_is_named_with_what_counts_and_what_came_of_the_key(
    lab: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert review(monkeypatch, "k?xuq", "0", "1", "--where", "") == 2
    assert review(monkeypatch, "k?xu q", "--where", "number < 2 and seed == 1") == 0
    shown = capsys.readouterr()
    assert "1 of 2" in shown.out
    assert "keep: nothing changes" in shown.out
    assert "key '?' means nothing here" in shown.err
    assert "excluded: camera moved" in shown.out
    assert "looked at" in shown.out


def test_a_release_and_no_screen_are_refused_in_one_line(
    lab: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert run(["review", "lab@v1", "--no-viewer"]) == 2
    assert "does not change: name a branch" in capsys.readouterr().err
    assert run(["review", "lab"]) == 2
    assert "pass --no-viewer" in capsys.readouterr().err
    assert run(["review", "lab", "--no-viewer", "--where", "target == 'pear'"]) == 2
    assert "none matches target == 'pear'" in capsys.readouterr().err


def test_contradictory_options_are_refused_and_decide_nothing(
    lab: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = GraspDataset.open(str(lab)).snapshot_id
    assert review(monkeypatch, "x", "01", "--where", "success", "--suspect", "--sort", "number") == 2
    said = capsys.readouterr().err
    assert "attempts are named and --where" in said
    assert "expected one order at most" in said
    assert GraspDataset.open(str(lab)).snapshot_id == before
