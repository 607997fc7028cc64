"""Runs as they are listed, shown and compared, and as a dataset names them."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.runs import ORIGIN, save_untrained

from handsight.cli.app import run
from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.training.run_folder import EVENTS, RUN_RECORD, WEIGHTS

LISTED = """\
run        created (UTC)     channels  data       attempts    AUC  accuracy   loss
runs/a     2026-03-01 12:00  rgbd      grasps@v1        80  0.875     0.750  0.500
runs/b[b]  2026-03-01 12:01  rgbd      grasps@v1        80  0.875     0.750  0.500
"""
COMPARED = """\
differs         a          b[b]
origins[0].ref  v1         v2
settings.batch  32         16
settings.seed   0          1
figures are of other held-out attempts in each run: data, seed or holdout differ
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with two runs of which one has a name like markup."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "84")
    save_untrained(tmp_path / "runs" / "a")
    save_untrained(tmp_path / "runs" / "b[b]", seed=1, batch=16, origins=(replace(ORIGIN, ref="v2"),))
    for minute, name in enumerate(("a", "b[b]")):
        stamp(tmp_path / "runs" / name, f"2026-03-01T12:0{minute}:00+00:00")
    return tmp_path


def stamp(run_folder: Path, created: str) -> None:
    """Give a run another time; its seal goes, as it is of all values."""
    values = json.loads((run_folder / RUN_RECORD).read_text())
    del values["record_sha256"]
    (run_folder / RUN_RECORD).write_text(json.dumps({**values, "created": created}))


def printed(capsys: pytest.CaptureFixture[str], *words: str, status: int = 0) -> str:
    capsys.readouterr()
    assert run(list(words)) == status
    return capsys.readouterr().out


def parsed(capsys: pytest.CaptureFixture[str], *words: str, status: int = 0) -> Any:
    return json.loads(printed(capsys, *words, "--json", status=status))


def test_runs_are_listed_by_time(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "runs", "ls")
    assert out.startswith(LISTED)
    assert out.removeprefix(LISTED).startswith("left out to fit 84 columns: kept, parameters;")
    first, second = parsed(capsys, "runs", "ls", str(folder / "runs"))
    assert first["run"] == str(folder / "runs" / "a")
    assert (first["fault"], first["auc"], first["kept"], first["passes"]) == (None, 0.875, 2, 3)
    assert first["data"] == second["data"] == ["lab/grasps@v1"]
    assert first["weights_sha256"] != second["weights_sha256"]


def test_a_damaged_run_hides_no_other(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "runs" / "a" / RUN_RECORD).write_text("{")
    out = " ".join(printed(capsys, "runs", "ls").split())
    assert "runs/b[b]" in out
    assert "runs/a/run.json is damaged (it is no JSON" in out
    whole, damaged = parsed(capsys, "runs", "ls")
    assert (whole["run"], whole["fault"]) == ("runs/b[b]", None)
    assert set(damaged) == {"run", "fault"}


def test_a_folder_without_runs_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "runs", "ls", str(tmp_path)).startswith("no run in or below")
    assert parsed(capsys, "runs", "ls", str(tmp_path)) == []


def test_a_run_shows_all_it_says_of_itself(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "runs", "show", "runs/a")
    values = json.loads((folder / "runs" / "a" / RUN_RECORD).read_text())
    facts = {tuple(line.split(maxsplit=1)) for line in out.splitlines()}
    for fact in (("snapshot", "ABCDEFGH"), ("digest", "d" * 64), ("batch", "32"), ("jitter.turn_rad", "0.17")):
        assert fact in facts
    assert values["weights_sha256"] in out
    assert "as model.safetensors is" in " ".join(out.split())
    assert "   2      0.5100          0.500  0.875     0.750  kept\n" in out
    shown = parsed(capsys, "runs", "show", "runs/a")
    assert shown["ok"] is True
    assert shown["record"] == values
    assert shown["files"] == {
        "weights": WEIGHTS, "weights_fault": None, "weights_named": True, "card": "current"
    }  # fmt: skip


def test_weights_of_another_run_are_found(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(folder / "runs" / "b[b]" / WEIGHTS, folder / "runs" / "a" / WEIGHTS)
    out = " ".join(printed(capsys, "runs", "show", "runs/a", status=1).split())
    assert "not those of this run: model.safetensors has the SHA-256" in out
    assert parsed(capsys, "runs", "show", "runs/a", status=1)["ok"] is False


def test_runs_are_compared(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "runs", "compare", "runs/a", "runs/b[b]")
    table = [line.split() for line in COMPARED.splitlines()]
    lines = [line.split() for line in out.splitlines()]
    assert all(line in lines for line in table)
    assert ["settings.epochs", "8", "8"] not in lines
    found = parsed(capsys, "runs", "compare", "runs/a", "runs/b[b]")
    assert found["differences"] == {"origins[0].ref": ["v1", "v2"], "settings.batch": [32, 16], "settings.seed": [0, 1]}
    assert found["held_out_alike"] is False
    assert [one["run"] for one in found["runs"]] == ["runs/a", "runs/b[b]"]
    same = printed(capsys, "runs", "compare", "runs/a", "runs/a")
    assert same.endswith("no setting, grid or origin differs\n")


@pytest.mark.parametrize("width", [60, 80, 120, 200])
@pytest.mark.parametrize("words", ["ls", "show runs/a", "compare runs/a runs/b[b] runs/a runs/b[b]"])
def test_a_screen_fits(
    words: str, width: int, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    for line in printed(capsys, "runs", *words.split()).splitlines():
        assert line == line.rstrip()
        assert len(line) <= width or max(map(len, line.split())) == 64, line


def test_a_dataset_names_its_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    header = make_header(seed=1)
    attempts = [make_attempt(header, at, outcome=Outcome.HELD if at % 2 else Outcome.EMPTY) for at in range(12)]
    repository = GraspRepository.create(tmp_path / "grasps")
    record(repository, header, attempts)
    repository.release("v1")
    address, out = f"{tmp_path}/grasps@v1", tmp_path / "run"
    assert parsed(capsys, "dataset", "info", address)["runs"] == []
    assert "trained on it" not in printed(capsys, "dataset", "info", address)
    printed(capsys, "train", address, "--out", str(out), "--epochs", "1", "--batch", "4", "--tensorboard")
    assert list((out / EVENTS).glob("*/events.out.tfevents.*"))
    (known,) = parsed(capsys, "dataset", "info", address)["runs"]
    values = json.loads((out / RUN_RECORD).read_text())
    assert known == {
        "run": str(out),
        "weights_sha256": values["weights_sha256"],
        "created": values["created"],
        "exists": True,
    }
    assert values["weights_sha256"][:12] in printed(capsys, "dataset", "info", address)
    shutil.rmtree(out)
    assert parsed(capsys, "dataset", "info", address)["runs"] == [{**known, "exists": False}]
    assert "  gone\n" in printed(capsys, "dataset", "info", address)
    assert GraspDataset.open(address).info().attempts == 12
