"""``handsight ablate`` and ``handsight crossval``, as they are called."""

from __future__ import annotations

import csv
import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from tests.support.s3_server import empty_bucket, s3_server
from tests.support.sweep_kills import kill_sweep
from tests.support.swept import make_swept

from handsight.cli.ablate import varied_of
from handsight.cli.app import run
from handsight.cli.errors import CommandError
from handsight.cli.sweep import sizes_of
from handsight.datasets import GraspRepository
from handsight.datasets.address import S3Prefix, location_of
from handsight.datasets.store.files import read_object, stored_files
from handsight.training.sweep.folder import FAILURE

QUICK = ("--sizes", "12,20", "--trials", "2", "--held-out", "0.34", "--epochs", "1", "--workers", "1")


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> str:
    return make_swept(tmp_path_factory.mktemp("ablate") / "grasps")


@pytest.fixture(scope="module")
def swept(grasps: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("swept") / "out"
    assert run(["ablate", grasps, "--channels", "rgb,depth", *QUICK, "--out", str(out)]) == 0
    return out


def printed(words: list[str], capsys: pytest.CaptureFixture[str], status: int = 0) -> Any:
    capsys.readouterr()
    assert run([*words, "--json"]) == status
    return json.loads(capsys.readouterr().out)


def refusal(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    assert run(words) == 2
    found = capsys.readouterr()
    assert not found.out
    return found.err


def test_a_sweep_leaves_its_plan_its_cells_its_tables_and_its_figure(
    swept: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert {path.name for path in swept.iterdir()} == {
        "plan.json",
        "cells",
        "cells.csv",
        "figure7.csv",
        "figure7.png",
        "figure7.svg",
        "README.md",
    }
    cells = list(csv.DictReader((swept / "cells.csv").read_text().splitlines()))
    assert len(cells) == 8
    assert {(row["channels"], row["size"], row["trial"]) for row in cells} == {
        (channels, size, trial) for channels in ("rgb", "depth") for size in ("12", "20") for trial in ("0", "1")
    }
    page = (swept / "README.md").read_text()
    assert "8 of 8 cells trained" in page
    assert "| rgb | depth | 20 | 2 |" in page
    (call,) = (line for line in page.splitlines() if line.startswith("handsight ablate run"))
    again = shlex.split(call.replace("--out DIR", f"--out {shlex.quote(str(swept))} --json"))[1:]
    capsys.readouterr()
    assert run(again) == 0
    assert json.loads(capsys.readouterr().out)["trained"] == 0


def test_the_same_call_again_trains_nothing_and_prints_the_same(
    grasps: str, swept: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = printed(["ablate", "run", grasps, "--channels", "rgb,depth", *QUICK, "--out", str(swept)], capsys)
    assert found["trained"] == 0
    assert found["states"] == {"done": 8, "failed": 0, "running": 0, "left": 0}
    assert {"channels", "size", "trial", "accuracy", "auc"} <= found["cells"][0].keys()
    plotted = printed(["ablate", "plot", str(swept)], capsys)
    assert plotted["rows"] == found["rows"]
    assert [row["size"] for row in found["rows"]] == [12, 12, 20, 20]


def test_another_plan_is_refused_with_every_difference(
    grasps: str, swept: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["ablate", grasps, "--channels", "depth", *QUICK[2:], "--seed", "4", "--by", "scene", "--out", str(swept)]
    before = (swept / "plan.json").read_bytes()
    said = refusal(words, capsys)
    for part in ("channels", "sizes", "seed 0, now 4", 'by "object", now "scene"', "--allow NAME"):
        assert part in said
    assert (swept / "plan.json").read_bytes() == before


def test_status_counts_cells_and_names_those_that_failed(
    grasps: str, swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = printed(["ablate", "status", str(swept)], capsys)
    assert found["rows"][0] == {"series": "rgb", "size": 20, "done": 2, "failed": 0, "running": 0, "left": 0}
    out = tmp_path / "failing"
    only = ["ablate", grasps, "--channels", "depth", *QUICK, "--out", str(out), "--only", "depth:12:0"]
    assert run(only) == 0
    cell = out / "cells" / "depth-12-001"
    cell.mkdir()
    (cell / FAILURE).write_text('{"error": "DivergedError", "message": "the loss is nan"}')
    status = printed(["ablate", "status", str(out)], capsys)
    assert status["failed"] == [{"cell": "depth-12-001", "why": "DivergedError: the loss is nan"}]
    assert status["seconds_left"] > 0
    assert printed([*only[:-1], "depth:12"], capsys, status=1)["states"]["failed"] == 1
    assert printed([*only[:-1], "depth:12", "--retry-failed"], capsys)["states"]["failed"] == 0


def test_a_dry_run_says_how_long_it_takes_and_writes_nothing(
    grasps: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    left = printed(["ablate", grasps, *QUICK, "--out", str(out), "--dry-run"], capsys)["left"]
    assert left["cells"] == 12
    assert left["seconds"] > 0
    assert not out.exists()


def test_crossval_tests_one_recipe_on_objects_never_seen(
    grasps: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["crossval", grasps, "--trials", "2", "--held-out", "0.34", "--epochs", "1", "-w", "1"]
    found = printed([*words, "--out", str(tmp_path / "out")], capsys)
    (row,) = found["rows"]
    assert (row["series"], row["size"], row["accuracy"]["trials"]) == ("rgbd", None, 2)
    assert {one["object"] for one in found["objects"]} <= {"apple", "cup", "duck", "egg", "fork", "jar"}
    capsys.readouterr()
    assert run([*words, "--out", str(tmp_path / "out")]) == 0
    assert "objects judged worst" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--sizes", "12,many"], "--sizes has 'many', expected numbers of attempts, or all"),
        (["--sizes", "12,900"], "size is 900, expected at most"),
        (["--channels", "rgb,hsv"], "channels are 'hsv', expected one of: rgbd, rgb, depth"),
        (["--channels", ""], "there is no value of channels"),
        (["--vary", "mixup"], "--vary is 'mixup', expected NAME=A,B"),
        (["--vary", "mood=good,bad"], "there is no 'mood' to vary"),
        (["--trials", "0"], "0 trials asked for, expected 1 to 1000"),
        (["--held-out", "1.5"], "the share held out is 1.5"),
        (["--by", "session"], "the attempts form 1 group by session"),
        (["--only", "rgbd:77"], "--only rgbd:77 names no cell"),
        (["--viewpoint", "pregrasp", "--ray-address", "x:1"], "goes with --engine ray"),
    ],
)
def test_bad_input_is_refused_before_anything_is_trained(
    grasps: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    out = tmp_path / "out"
    assert said in refusal(["ablate", grasps, "--trials", "2", "--held-out", "0.34", *words, "--out", str(out)], capsys)
    assert not out.exists()


def test_a_release_that_was_removed_is_named_and_what_is_done_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    repository = GraspRepository.open(make_swept(tmp_path / "grasps"))
    repository.release("v1", message="to sweep over")
    out = tmp_path / "out"
    words = ["ablate", f"{repository.path}@v1", "--channels", "depth", *QUICK, "--out", str(out)]
    assert run([*words, "--only", "depth:12:0"]) == 0
    repository.icechunk_repository.delete_tag("v1")
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    said = refusal(words, capsys)
    assert len(said.splitlines()) == 1
    assert "v1" in said
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
    assert printed(["ablate", "status", str(out)], capsys)["rows"][-1]["done"] == 1
    assert run(["ablate", "plot", str(out)]) == 0


def test_a_folder_with_other_things_is_refused(grasps: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    assert "holds other files" in refusal(["ablate", grasps, *QUICK, "--out", str(tmp_path)], capsys)
    assert "holds no sweep" in refusal(["ablate", "status", str(tmp_path)], capsys)
    assert "holds no sweep" in refusal(["ablate", "plot", str(tmp_path)], capsys)


def test_what_options_say_is_read_as_it_is_meant() -> None:
    assert sizes_of("250, all,30") == [250, None, 30]
    assert varied_of(["mixup=0,0.2", "lr=1e-3"]) == {"mixup": ["0", "0.2"], "lr": ["1e-3"]}
    with pytest.raises(CommandError, match="every name once"):
        varied_of(["lr=1", "lr=2"])


def test_a_sweep_kept_in_a_bucket_goes_on_on_another_machine(
    grasps: str, swept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = "s3://lab/week/out"
    words = ["ablate", grasps, "--channels", "rgb,depth", *QUICK, "--out", out]
    with s3_server() as server:
        empty_bucket(server, monkeypatch)
        monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "first"))
        assert printed([*words, "--dry-run"], capsys)["left"]["cells"] == 8
        assert "holds no sweep" in refusal(["ablate", "status", out], capsys)
        assert printed([*words, "--only", "rgb:12"], capsys)["trained"] == 2
        monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "second"))
        assert sum(row["done"] for row in printed(["ablate", "status", out], capsys)["rows"]) == 2
        found = printed(words, capsys)
        assert (found["out"], found["trained"], found["states"]["done"]) == (out, 6, 8)
        assert run(["ablate", "plot", out]) == 0
        location = location_of(out)
        assert isinstance(location, S3Prefix)
        assert {path.name for path in swept.iterdir() if path.is_file()} < stored_files(location).keys()
        told = [f"cells/{path.parent.name}/{path.name}" for path in swept.glob("cells/*/predictions.csv")]
        assert all(read_object(location, name) == (swept / name).read_bytes() for name in told)


def test_a_sweep_that_is_killed_again_and_again_ends_as_one_that_was_left_alone(tmp_path: Path) -> None:
    """``python -P tests/support/sweep_kills.py`` kills more often."""
    seen = kill_sweep(tmp_path, kills=2, seed=1, trials=2)
    assert seen.changed == seen.differing == seen.left == ()
