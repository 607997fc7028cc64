"""``handsight view ablation`` as its user meets it: the page of a sweep, opened in a browser."""

from __future__ import annotations

import json
import shutil
import webbrowser
from pathlib import Path

import pytest
from tests.support.html_page import HtmlPage
from tests.support.swept import Threads, make_swept, swept_plan

from handsight.cli.app import run
from handsight.training.sweep.folder import SweepFolder
from handsight.training.sweep.prepare import settle
from handsight.training.sweep.run import run_sweep


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep")
    plan = swept_plan(make_swept(folder / "data"), trials=2, sizes=(12,))
    settle(folder / "figure7", plan)
    run_sweep(plan, SweepFolder(folder / "figure7"), workers=1, engine=Threads())
    return folder / "figure7"


def said_of(path: Path) -> str:
    """The words of a page whose form is sound."""
    found = HtmlPage(path.read_text())
    assert found.faults() == []
    return " ".join(" ".join(found.words).split())


def test_a_sweep_is_told_and_opened(
    sweep: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened: list[str] = []

    def note(address: str) -> bool:
        opened.append(address)
        return True

    monkeypatch.setattr(webbrowser, "open", note)
    assert run(["view", "ablation", str(sweep)]) == 0
    assert opened == [(sweep / "report.html").as_uri()]
    text = said_of(sweep / "report.html")
    for said in (
        "rgb less depth",
        "Means over trials",
        "4 done",
        f"handsight ablate plot {sweep}",
        "handsight ablate run",
    ):
        assert said in text, said
    capsys.readouterr()
    assert run(["view", "ablation", str(sweep), "--no-open", "--out", str(tmp_path / "x.html"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {"report": str(tmp_path / "x.html"), "bytes": (tmp_path / "x.html").stat().st_size, "opened": False}
    assert len(opened) == 1


def test_a_sweep_of_which_nothing_is_done_is_refused(
    sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(sweep, tmp_path / "new")
    shutil.rmtree(tmp_path / "new" / "cells")
    (tmp_path / "new" / "cells").mkdir()
    assert run(["view", "ablation", str(tmp_path / "new"), "--no-open"]) == 2
    assert "no cell is done" in capsys.readouterr().err
    assert run(["view", "ablation", str(tmp_path)]) == 2
    assert "holds no sweep" in capsys.readouterr().err
