"""``handsight view dataset`` as its user meets it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from tests.support.lab import make_lab
from tests.support.rrd import colours, read_picture

from handsight.cli.app import run

LIMIT_S = 120.0


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    return Path(str(make_lab(tmp_path / "lab").path))


def test_the_first_cards_are_drawn_into_a_file(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = run(["view", "dataset", "lab", "--picture", "cards.png", "--sort", "target", "-n", "8", "--json"])
    shown = capsys.readouterr()
    if "found no Vulkan driver" in shown.err:
        pytest.skip(shown.err.strip())
    assert status == 0
    told = json.loads(shown.out)
    assert (told["picture"], told["attempts"]) == ("cards.png", 8)
    assert told["bytes"] > 0
    assert colours(read_picture(lab.parent / "cards.png")) > 300


@pytest.mark.parametrize("way", ["--web", "--notebook"])
def test_the_page_is_served_on_the_loopback_and_nothing_is_left_behind(lab: Path, tmp_path: Path, way: str) -> None:
    program = "from handsight.cli.app import main; main()"
    command = [sys.executable, "-P", "-c", program, "view", "dataset", "lab", way, "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        said = ""
        for line in process.stdout:
            said += line
            if line.startswith("}"):
                break
        told = json.loads(said)
        assert re.match(
            r"http://127\.0\.0\.1:\d+/\?url=rerun%2Bhttp%3A%2F%2F127\.0\.0\.1%3A\d+%2Fentry%2F", told["page"]
        )
        assert told.get("cell", told["page"]).count(told["page"]) == 1
        assert ("cell" in told) == (way == "--notebook")
        with urllib.request.urlopen(told["page"], timeout=LIMIT_S) as page:
            assert b"<html" in page.read()
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        assert children
        process.send_signal(signal.SIGINT)
        assert process.wait(LIMIT_S) == 130
        assert [child for child in children if os.path.exists(f"/proc/{child}")] == []  # noqa: PTH110
    finally:
        process.kill()
        process.communicate()


def test_newcomers_mistakes_are_answered_in_one_line(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    calls = {
        "view dataset lab": "there is no display for the viewer's window",
        "view dataset lab 3 --where success --web": "attempts are named and --where",
        "view dataset lab --suspect --sort number --web": "expected one order at most",
        "view dataset lab --web --picture x.png": "expected one of them",
        "view dataset lab --web --notebook": "--web and --notebook are given, expected one of them",
        "view dataset lab --like 3 --web": "add --model RUN",
        "view dataset lab --picture x.jpg": "expected a file name that ends in .png",
        "view dataset lab --web --sort targt": "there is no column 'targt'",
        "view dataset lab --web --filter slips -n 1 --where number<0": "none matches",
    }
    for call, said in calls.items():
        assert run(call.split()) == 2, call
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1


def test_an_empty_dataset_is_named_as_such(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["dataset", "init", "empty"]) == 0
    capsys.readouterr()
    assert run(["view", "dataset", "empty", "--web"]) == 2
    assert "holds 0 attempts, and there is nothing to look at" in capsys.readouterr().err
