"""``handsight dataset repeat`` on the real simulator: labels that stay where grasps do, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.refusals import check_refused

from handsight.cli.app import run
from handsight.cli.wiring.resimulate import Resimulator
from handsight.datasets import GraspDataset, GraspRepository


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Some successes and some failures, each in the scene that its number makes."""
    path = tmp_path_factory.mktemp("repeat") / "grasps"
    assert run(["collect", "sim", str(path), "-n", "24", "--objects", "blocks-test", "--seed", "3", "-w", "2"]) == 0
    labels = GraspDataset.open(str(path)).attempts["recorded_success"]
    assert 2 <= int(labels.sum()) <= 10
    return path


def repeated(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    capsys.readouterr()
    assert run(["dataset", "repeat", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_where_they_were_all_end_as_they_did_and_far_beside_successes_do_not(
    grasps: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    exact = repeated(capsys, str(grasps), "-n", "6", "--repeats", "1", "--shift-mm", "0", "--turn-deg", "0")
    assert [row["rate"] for row in exact["rows"]] == [1.0, 1.0]
    assert exact["auc"] == 1.0
    assert sum(row["attempts"] for row in exact["rows"]) == 6
    far = repeated(capsys, str(grasps), "-n", "6", "--repeats", "1", "--shift-mm", "60", "-w", "1")
    (success,) = [row for row in far["rows"] if row["recorded"] == "success"]
    assert success["rate"] < 0.7
    assert repeated(capsys, str(grasps), "-n", "6", "--repeats", "1", "--shift-mm", "60") == far
    assert {one["attempt"] for one in far["attempts"]} == {one["attempt"] for one in exact["attempts"]}


def test_the_table_is_told_and_one_label_alone_has_no_auc(
    grasps: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    words = ["dataset", "repeat", str(grasps), "--repeats", "1", "--shift-mm", "0", "--where", "success", "-n", "1"]
    assert run(words) == 0
    said = capsys.readouterr().out
    assert "1/1" in said
    assert "1 repeat of each, 0 mm and 1 deg beside it" in said
    assert "AUC" not in said, "with one label there is none"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--repeats", "0"], "repeats is 0, expected 1 or more"),
        (["--shift-mm", "nan", "--turn-deg", "-1"], "shift is nan mm, expected 0 to 100; turn is -1 deg"),
        (["--where", "target == 'nothing'"], "holds can be performed again"),
        (["--where", "target =="], "where"),
    ],
)
def test_a_bad_value_is_refused_in_one_line(
    grasps: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    check_refused(capsys, ["dataset", "repeat", str(grasps), *words], told)


@pytest.mark.parametrize(
    ("source", "station", "told"),
    [
        ("ur10", None, "not simulated"),
        ("sim", None, "by a simulator that is not described"),
        ("sim", {"physics": 1}, "under version 1 of the physics"),
    ],
)
def test_what_cannot_be_simulated_is_refused_and_no_resimulator_breaks_on_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], source: str, station: dict[str, int] | None, told: str
) -> None:
    header = make_header(source=source)
    config = header.config if station is None else {**header.config, "station": station}
    header = replace(header, config=config)
    repository = GraspRepository.create(tmp_path / "grasps")
    record(repository, header, [make_attempt(header, number) for number in range(12)])
    check_refused(capsys, ["dataset", "repeat", str(tmp_path / "grasps")], told)
    assert Resimulator()(header, 0) is None
    assert run(["dataset", "doctor", str(tmp_path / "grasps"), "--resimulate", "3", "--json"]) in (0, 1)
