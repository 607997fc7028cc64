"""The command on an untrained network and one scene: what it prints, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from tests.support.refusals import check_refused

from handsight.cli.app import run
from handsight.servoing.homography import InputGrid
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.run import DataOrigin, save_run
from handsight.training.settings import TrainSettings


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("prediction") / "run"
    origin = DataOrigin(dataset="none", ref="main", snapshot="", digest="", view="overhead", attempts=0)
    torch.manual_seed(0)
    save_run(folder, GraspQualityNetwork(GqnConfig()), origins=[origin], grid=InputGrid(), settings=TrainSettings())
    return folder


def test_one_scene_is_told_in_tables_and_in_json(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    words = ["prediction", "--model", str(model), "--objects", "blocks-test", "-n", "1", "-w", "1"]
    assert run([*words, "--json"]) == 0
    results = json.loads(capsys.readouterr().out)
    assert (results["fault"], results["failed"], results["scenes"]) == (None, [], 1)
    assert len(results["samples"]) + results["unreachable"] == 9
    overall = [row for row in results["rows"] if row["height_low_mm"] is None]
    assert sum(row["steps"] for row in overall) == len(results["samples"])
    assert run(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    kinds = [line.split()[0] for line in lines if line.startswith(("moved", "turned"))]
    assert kinds == ["moved", "moved", "turned", "turned"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--scenes", "0"], "scenes is 0, expected 1 or more"),
        (["--workers", "0"], "workers is 0, expected 1 or more"),
        (["--objects", "nothing"], "unknown object set 'nothing'"),
    ],
)
def test_a_bad_value_is_refused_in_one_line(
    model: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    check_refused(capsys, ["prediction", "--model", str(model), *words], said)
