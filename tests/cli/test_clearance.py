"""``handsight clearance`` on an untrained network: what it prefers is arbitrary, what is told of it is tested."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch
from tests.support.refusals import check_refused

from handsight.cli.app import run
from handsight.cli.wiring import clearances
from handsight.evaluation.clearance import ClearedTable, clear_tables
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


def test_an_interrupted_clearance_goes_on_and_another_is_refused(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "tables.jsonl"
    words = ["clearance", "--model", str(model), "--objects", "blocks-test", "--objects-per-scene", "1"]
    words += ["--methods", "random,cem-1", "--failures", "1", "-w", "1"]

    def tables(*more: str) -> Any:
        assert run([*words, "--json", *more]) == 0
        return json.loads(capsys.readouterr().out)["tables"]

    whole = tables("-n", "2")
    assert tables("-n", "1", "--out", str(out)) == whole[:2]
    out.write_bytes(out.read_bytes()[:-20])
    performed = []

    def counting(*arguments: Any, on_table: Any, **more: Any) -> list[ClearedTable]:
        def told(table: ClearedTable) -> None:
            performed.append(table)
            on_table(table)

        return clear_tables(*arguments, on_table=told, **more)

    monkeypatch.setattr(clearances, "clear_tables", counting)
    assert tables("-n", "2", "--out", str(out)) == whole
    assert len(performed) == 3, "one of four tables was in the journal"
    assert tables("-n", "2", "--out", str(out)) == whole
    assert len(performed) == 3
    before = out.read_bytes()
    check_refused(capsys, [*words, "--failures", "2", "--out", str(out)], "failures is 2, and was 1")
    check_refused(capsys, [*words, "--level", "--out", str(out)], "level is true, and was null")
    check_refused(capsys, [*words, "--objects-per-scene", "2", "--out", str(out)], "objects_per_scene is 2, and was 1")
    assert out.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--tables", "0"], "tables is 0, expected 1 or more"),
        (["--failures", "0"], "failures is 0, expected 1 or more"),
        (["--methods", "nothing"], "'nothing'"),
        (["--objects", "nothing"], "unknown object set 'nothing'"),
        (["--out", "/nowhere/tables.jsonl"], "--out is /nowhere/tables.jsonl"),
        (["--ray-address", "auto"], "--ray-address"),
    ],
)
def test_a_bad_value_is_refused_in_one_line(
    model: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    check_refused(capsys, ["clearance", "--model", str(model), *words], told)
