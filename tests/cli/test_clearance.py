"""``handsight clearance`` on an untrained network: what it prefers is arbitrary, what is told of it is tested."""

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
    folder = tmp_path_factory.mktemp("clearance") / "run"
    origin = DataOrigin(dataset="none", ref="main", snapshot="", digest="", view="overhead", attempts=0)
    torch.manual_seed(0)
    save_run(folder, GraspQualityNetwork(GqnConfig()), origins=[origin], grid=InputGrid(), settings=TrainSettings())
    return folder


def test_tables_are_told_in_rows_and_in_json(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    words = ["clearance", "--model", str(model), "--objects", "blocks-test", "--objects-per-scene", "2"]
    words += ["--methods", "random,cem-1", "--failures", "2", "-n", "2", "-w", "1"]
    assert run([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["method"] for row in told["rows"]] == ["random", "cem-1"]
    assert len(told["tables"]) == 4
    for row in told["rows"]:
        assert row["objects"] == 4
        assert 0 <= row["cleared"] <= 4
        assert row["cleared_share"] == pytest.approx(row["cleared"] / 4)
    (compared,) = told["comparisons"]
    assert compared["pairs"] == 2
    assert run(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split()[0] for line in lines if line.startswith(("random", "cem-1"))] == ["random", "cem-1", "cem-1"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--tables", "0"], "tables is 0, expected 1 or more"),
        (["--failures", "0"], "failures is 0, expected 1 or more"),
        (["--methods", "nothing"], "'nothing'"),
        (["--objects", "nothing"], "unknown object set 'nothing'"),
    ],
)
def test_a_bad_value_is_refused_in_one_line(
    model: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    check_refused(capsys, ["clearance", "--model", str(model), *words], told)
