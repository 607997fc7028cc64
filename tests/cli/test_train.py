"""What is learnt from, named version by version and picture by picture."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.factories import make_attempt, make_header, record

from handsight.cli.app import run
from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.training.run import load_run


def make_dataset(path: Path, *, size: int, seed: int, near_pictures: bool) -> str:
    """Grasps that hold and come up empty by turns."""
    header = make_header(seed=seed)
    attempts = [make_attempt(header, at, outcome=Outcome.HELD if at % 2 else Outcome.EMPTY) for at in range(size)]
    kept = attempts if near_pictures else [replace(attempt, pregrasp=None) for attempt in attempts]
    record(GraspRepository.create(path), header, kept)
    return str(path)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    folder = tmp_path_factory.mktemp("train")
    first = make_dataset(folder / "random", size=12, seed=1, near_pictures=False)
    return first, make_dataset(folder / "on-policy", size=8, seed=2, near_pictures=True)


def printed(words: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    assert run([*words, "--json"]) == 0
    parsed: dict[str, Any] = json.loads(capsys.readouterr().out)
    return parsed


def test_a_run_of_two_datasets_and_both_pictures_names_all_it_learnt_from(
    two: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    words = ["train", *two, "--out", str(out), "--viewpoint", "both", "--epochs", "2"]
    planned = printed([*words, "--dry-run"], capsys)
    expected = [(two[0], "overhead", 12), (two[1], "overhead", 8), (two[1], "pregrasp", 8)]
    assert [(part["dataset"], part["view"], part["attempts"]) for part in planned["parts"]] == expected
    assert planned["attempts"] == 28
    assert not out.exists()
    epoch = printed(words, capsys)["epoch"]
    loaded = load_run(out)
    assert [(one.dataset, one.view, one.attempts) for one in loaded.origins] == expected
    assert loaded.origins[2].digest == GraspDataset.open(two[1]).digest
    assert epoch["number"] == loaded.record["kept_epoch"] == 2


def test_the_plan_and_the_end_are_told_in_words(
    two: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["train", *two, "--out", str(tmp_path / "run"), "--epochs", "1"]
    assert run([*words, "--dry-run"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"{two[1]}: 8 attempts, overhead picture" in said
    assert "would train on 20 pictures in all and write" in said
    assert run(words) == 0
    assert "pass 1 of 1 kept" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        (["{0}", "{1}", "{0}"], "is named more than once"),
        (["{1}", "{0}", "--viewpoint", "pregrasp"], "has no labelled attempt with a pregrasp picture"),
        (["{0}", "{0}-none"], "there is no dataset"),
        (["{0}", "{1}@v9"], "v9"),
    ],
)
def test_data_that_cannot_be_learnt_from_are_refused_before_anything_is_made(
    options: list[str], fault: str, two: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [option.format(*two) for option in options]
    assert run(["train", *words, "--out", str(tmp_path / "run")]) == 2
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert fault in line
    assert captured.out == ""
    assert not (tmp_path / "run").exists()
