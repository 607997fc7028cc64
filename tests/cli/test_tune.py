"""``handsight tune``, as it is called."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from tests.support.swept import make_swept

from handsight.cli.app import run
from handsight.training.settings import TrainSettings

QUICK = ("--proposals", "2", "--trials", "1", "--held-out", "0.34", "--size", "12", "--epochs", "1", "--workers", "1")


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> str:
    return make_swept(tmp_path_factory.mktemp("tune") / "grasps")


@pytest.fixture(scope="module")
def tuned(grasps: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("tuned") / "out"
    assert run(["tune", grasps, *QUICK, "--out", str(out)]) == 0
    return out


def test_a_search_leaves_its_plan_its_study_and_what_it_found(tuned: Path) -> None:
    names = {"plan.json", "study.log", "proposals", "proposals.csv", "best.json"}
    assert {path.name for path in tuned.iterdir()} == names
    rows = list(csv.DictReader((tuned / "proposals.csv").read_text().splitlines()))
    assert {row["proposal"] for row in rows} == {"0", "1"}
    assert {row["state"] for row in rows} == {"done"}
    best = json.loads((tuned / "best.json").read_text())
    assert best["number"] == int(rows[0]["proposal"])
    assert best["loss"] == min(float(row["loss"]) for row in rows)
    (usual,) = (row for row in rows if row["proposal"] == "0")
    assert float(usual["learning_rate"]) == TrainSettings().learning_rate
    assert usual["difference"] == ""


def test_a_search_that_is_over_prints_it_again(grasps: str, tuned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["tune", grasps, *QUICK, "--out", str(tuned)]
    assert run([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["states"]["done"] == 2
    assert [row["number"] for row in found["proposals"]] != []
    assert found["best"] == found["proposals"][0]
    assert found["best"]["settings"]["epochs"] == 1
    assert run(words) == 0
    text = capsys.readouterr().out
    assert "0 (usual)" in text
    assert "2 of 2 proposals done" in text


def test_a_trial_says_what_would_be_done(
    grasps: str, tuned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["tune", grasps, *QUICK, "--dry-run"]
    assert run([*words, "--out", str(tmp_path / "new"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["left"]["cells"] == 2
    assert "learning_rate" in found["plan"]["space"]
    assert not (tmp_path / "new").exists()
    before = {path: path.read_bytes() for path in tuned.rglob("*") if path.is_file()}
    assert run([*words, "--out", str(tuned), "--proposals", "5"]) == 0
    assert "3 trainings left" in capsys.readouterr().out
    assert {path: path.read_bytes() for path in tuned.rglob("*") if path.is_file()} == before


def test_what_was_found_is_trained_by(
    grasps: str, tuned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    best = json.loads((tuned / "best.json").read_text())["settings"]
    words = ["train", grasps, "--out", str(tmp_path / "run"), "--recipe", str(tuned / "best.json")]
    assert run([*words, "--lr", "0.002", "--batch", "200"]) == 2
    assert "--batch, --lr is given beside --recipe" in capsys.readouterr().err
    assert run([*words[:-1], str(tmp_path / "none.json")]) == 2
    assert "none.json, expected a file: best.json" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    assert run([*words, "--seed", "5"]) == 0
    settings = json.loads((tmp_path / "run" / "run.json").read_text())["settings"]
    assert settings == {**best, "balance": False, "seed": 5}


def test_a_bucket_is_no_folder_of_a_search(
    grasps: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["tune", grasps, "--out", "s3://lab/out"]) == 2
    assert "--out is s3://lab/out, expected a folder" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--trials", "2"], "trials 1, now 2"),
        (["--channels", "depth", "--seed", "4"], 'channels ["rgbd"], now ["depth"]; '),
        (["--proposals", "0"], "--proposals is 0, expected at least 1"),
        (["--size", "12,20"], "--size is '12,20', expected one number"),
        (["--size", "500"], "size is 500, expected at most"),
    ],
)
def test_what_does_not_fit_is_refused(
    grasps: str, tuned: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["tune", grasps, *QUICK, *words, "--out", str(tuned)]) == 2
    found = capsys.readouterr()
    assert said in found.err
    assert not found.out
