"""The command on an untrained network: what it prefers is arbitrary, what is told of it is what is tested."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from tests.support.refusals import check_refused

from handsight.cli.app import run
from handsight.cli.wiring import evaluations
from handsight.evaluation.evaluate import evaluate
from handsight.evaluation.trial import Trial
from handsight.servoing.homography import InputGrid
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.run import DataOrigin, save_run
from handsight.training.settings import TrainSettings

THREE = ("--methods", "random,cem-1,first-order")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("evaluate")
    origin = DataOrigin(dataset="none", ref="main", snapshot="", digest="", view="overhead", attempts=0)
    for seed, name in enumerate(("run", "other")):
        torch.manual_seed(seed)
        network = GraspQualityNetwork(GqnConfig())
        save_run(folder / name, network, origins=[origin], grid=InputGrid(), settings=TrainSettings())
    return folder / "run"


def evaluated(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    capsys.readouterr()
    assert run(["evaluate", *words, "-w", "1", "--json"]) == 0
    results = json.loads(capsys.readouterr().out)
    for trial in results["trials"]:
        trial.pop("compute_s")
    return results


def test_an_interrupted_evaluation_over_several_sets_goes_on(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, figure = tmp_path / "trials.jsonl", tmp_path / "moves.png"
    words = ("--model", str(model), "--objects", "blocks-test,household-test", "--methods", "random,cem-1")
    whole = evaluated(capsys, *words, "--trials", "2", "--figure", str(figure))
    sets_and_methods = [(row["objects"], row["method"]) for row in whole["rows"]]
    assert sets_and_methods == [(o, m) for o in ("blocks-test", "household-test") for m in ("random", "cem-1")]
    assert [row["trials"] + row["aborted"] for row in whole["rows"]] == [2, 2, 2, 2]
    assert {row["objects"] for row in whole["comparisons"]} == {"blocks-test", "household-test"}
    assert figure.read_bytes()[1:4] == b"PNG"

    evaluated(capsys, *words, "--trials", "1", "--out", str(out))
    out.write_bytes(out.read_bytes()[:-20])
    performed = []

    def counting(*arguments: Any, on_trial: Any, **more: Any) -> list[Trial]:
        def told(trial: Trial) -> None:
            performed.append(trial)
            on_trial(trial)

        return evaluate(*arguments, on_trial=told, **more)

    monkeypatch.setattr(evaluations, "evaluate", counting)
    resumed = evaluated(capsys, *words, "--trials", "2", "--out", str(out))
    assert len(performed) == 5, "three of eight trials were in the journal"
    assert resumed["trials"] == whole["trials"]
    assert evaluated(capsys, *words, "--trials", "2", "--out", str(out))["trials"] == whole["trials"]
    assert len(performed) == 5


def test_a_journal_of_other_weights_is_refused(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "trials.jsonl"
    words = ("--objects", "blocks-test", "--methods", "random", "--trials", "1", "--out", str(out))
    evaluated(capsys, "--model", str(model), *words)
    before = out.read_bytes()
    other = ["evaluate", "--model", str(model.with_name("other")), *words, "--seed", "5"]
    check_refused(capsys, other, "weights_sha256 is ")
    check_refused(capsys, other, "seed is 5, and was 1000000")
    check_refused(capsys, ["evaluate", "--model", str(model), *words, "--level"], "level is true, and was null")
    assert out.read_bytes() == before
    level = tmp_path / "level.jsonl"
    words = (*words[:-1], str(level))
    assert evaluated(capsys, "--model", str(model), *words, "--level")["level"]
    check_refused(capsys, ["evaluate", "--model", str(model), *words], "level is null, and was true")


def scripted(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> None:
    """Every trial ends as is said, and none is performed."""

    def ended(factory: Any, settings: Any, *, known: Any, engine: Any, on_trial: Any) -> list[Trial]:
        plain = Trial(
            number=0, method="", success=False, failure="", moves=0, compute_s=0.01, truth_held=False, score=0.5
        )
        return [
            replace(plain, number=number, method=method, **changes)
            for number in range(settings.trials)
            for method in settings.methods
        ]

    monkeypatch.setattr(evaluations, "evaluate", ended)


def test_status_1_with_the_reason_where_every_trial_was_aborted(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scripted(monkeypatch, aborted=True, failure="look: the camera is gone")
    assert run(["evaluate", "--model", str(model), *THREE, "--trials", "2", "--json"]) == 1
    captured = capsys.readouterr()
    results = json.loads(captured.out)
    assert [row["trials"] for row in results["rows"]] == [0, 0, 0]
    assert [row["aborted"] for row in results["rows"]] == [2, 2, 2]
    (line,) = captured.err.splitlines()
    assert line.startswith("error: every trial was aborted (6 trials)")
    assert "the camera is gone" in line


def test_the_tables_that_are_asked_for_are_printed(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    scripted(monkeypatch, closed_m=0.0)
    words = ["evaluate", "--model", str(model), *THREE, "--trials", "3", "--objects", "blocks-test"]
    assert run(words) == 0
    plain = capsys.readouterr().out
    assert "McNemar" in plain
    assert "closed on nothing" not in plain
    assert "score at the grasp" not in plain
    assert run([*words, "--causes", "--calibration", "--against", "random"]) == 0
    told = capsys.readouterr().out
    assert "cem-1 on blocks-test: 3 failures in 3 trials, 3 below the threshold" in told
    assert "3  at the table, closed on nothing" in told
    assert "0.40 - 0.60" in told
    assert "first-order  random" in told


def test_a_disturbed_station_is_tried_with_one_look_too(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    scripted(monkeypatch, closed_m=0.0)
    words = ["evaluate", "--model", str(model), *THREE, "--trials", "3", "--disturb", "hand-eye:5mm"]
    assert run([*words, "--json"]) == 0
    results = json.loads(capsys.readouterr().out)
    assert results["disturbance"] == "hand-eye:5mm"
    assert [row["method"] for row in results["one_look"]["rows"]] == ["cem-1, one look", "first-order, one look"]
    assert [row["pairs"] for row in results["one_look"]["comparisons"]] == [3, 3]
    assert run(words) == 0
    assert "with one look, disturbed by hand-eye:5mm" in capsys.readouterr().out
    assert run([*words, "--methods", "random", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["one_look"] == {"rows": [], "comparisons": []}


def test_what_is_moved_is_moved_for_the_closed_loop_and_the_open_one(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No trial is made up; and a journal of one size is none of another."""
    out = tmp_path / "trials.jsonl"
    words = ["--model", str(model), "--objects", "blocks-test", "--methods", "random,cem-1", "--trials", "1"]
    results = evaluated(capsys, *words, "--disturb", "moved:20mm", "--out", str(out))
    assert results["disturbance"] == "moved:20mm"
    assert [row["method"] for row in results["one_look"]["rows"]] == ["cem-1, one look"]
    assert [row["trials"] + row["aborted"] for row in (*results["rows"], *results["one_look"]["rows"])] == [1, 1, 1]
    check_refused(capsys, ["evaluate", *words, "--disturb", "moved:30mm", "--out", str(out)], "moved:30mm")


def mistakes(folder: Path) -> dict[str, tuple[list[str], str]]:
    return {
        "two sets": (["--objects", "x,blocks-test,y"], "unknown object set 'x'"),
        "the second of two sets": (["--objects", "x,blocks-test,y"], "unknown object set 'y'"),
        "no set": (["--objects", " , "], "--objects is ' , '"),
        "a reference that is not compared": (["--against", "luck"], "against is 'luck'"),
        "a reference left out": (["--methods", "random", "--against", "cem-1"], "against is 'cem-1'"),
        "an unknown disturbance": (["--disturb", "luck:5mm"], "disturb is 'luck:5mm'"),
        "a disturbance without size": (["--disturb", "hand-eye:0mm"], "disturb is 'hand-eye:0mm'"),
        "a disturbance too large": (["--disturb", "hand-eye:21deg"], "at most 20 deg, such as hand-eye:2deg"),
        "a folder for a journal": (["--out", str(folder)], "is a folder"),
        "no folder for a journal": (["--out", str(folder / "no" / "t.jsonl")], "--out is"),
        "another file for a journal": (["--out", str(folder / "notes")], "is no journal of an evaluation"),
        "no folder for a figure": (["--figure", str(folder / "no" / "f.png")], "there is no folder"),
        "another format of figure": (["--figure", str(folder / "f.gif")], "ends in .png"),
        "a figure of no moves": (
            ["--methods", "random", "--figure", str(folder / "f.png")],
            "none of the methods servoes",
        ),
    }


@pytest.mark.parametrize("name", mistakes(Path()))
def test_a_bad_value_is_refused_in_one_line(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    (tmp_path / "notes").write_text("notes\n")
    words, said = mistakes(tmp_path)[name]
    check_refused(capsys, ["evaluate", "--model", str(model), *words], said)
    assert [path.name for path in tmp_path.iterdir()] == ["notes"]
