"""The executable as its user meets it: exit status, one line for every mistake, JSON that programs rely on."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import pytest
from tests.support.refusals import check_refused

from handsight.cli.app import NOUNS, run
from handsight.datasets import GraspDataset
from handsight.viz.figures.pictures import WIDTH_PX

pytestmark = pytest.mark.timeout(900)  # The demo, a whole line of collecting, training and trials, on a busy machine.


@pytest.fixture(scope="module")
def demo_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The whole demo, as small as it can be."""
    out = tmp_path_factory.mktemp("cli") / "demo"
    assert run(["demo", "--out", str(out), "--attempts", "40", "--trials", "2"]) == 0
    return out


def json_of(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    capsys.readouterr()
    assert run(words) == 0
    return json.loads(capsys.readouterr().out)


def test_the_demo_leaves_what_it_promises(demo_folder: Path) -> None:
    names = {path.name for path in demo_folder.iterdir()}
    assert {"grasps", "run", "results.json", "results.png", "heatmaps.rrd", "servo_trace.rrd"} <= names
    results = json.loads((demo_folder / "results.json").read_text())
    rows = {row["method"]: row for row in results["rows"]}
    assert set(rows) == {"random", "cem-1", "first-order", "global"}
    for row in rows.values():
        assert {"method", "objects", "trials", "successes", "rate", "ci95", "step_ms", "mean_steps"} <= set(row)
        assert row["trials"] == 2
        low, high = row["ci95"]
        assert 0 <= low <= row["rate"] <= high <= 1
    record = json.loads((demo_folder / "run" / "run.json").read_text())
    (origin,) = record["origins"]
    assert origin["digest"] == GraspDataset.open(str(demo_folder / "grasps")).digest


def test_a_report_on_the_demo_shows_the_trials_that_failed(demo_folder: Path, tmp_path: Path) -> None:
    trials = json.loads((demo_folder / "results.json").read_text())["trials"]
    failed = [one for one in trials if not one["success"] and one["score"] is not None and not one["aborted"]]
    assert run(["report", str(demo_folder), "--replays", "1", "--out", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text()
    assert ("1 trial that failed" in page) == bool(failed)
    assert "ends otherwise here than it did" not in page


def test_the_demo_again_does_nothing_twice(demo_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written = {path: path.stat().st_mtime_ns for path in (demo_folder / "results.json", demo_folder / "run/run.json")}
    snapshot = GraspDataset.open(str(demo_folder / "grasps")).snapshot_id
    words = ["demo", "--out", str(demo_folder), "--attempts", "40", "--trials", "2"]
    told = json_of(capsys, *words, "--json")
    assert {path: path.stat().st_mtime_ns for path in written} == written
    assert GraspDataset.open(str(demo_folder / "grasps")).snapshot_id == snapshot
    assert told["rows"] == json.loads((demo_folder / "results.json").read_text())["rows"]
    assert told["dataset"] == f"{demo_folder}/grasps@demo-seed0-40"
    assert told["files"]["trace"] == str(demo_folder / "servo_trace.rrd")


def test_info_and_ls_and_show_agree(demo_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dataset = str(demo_folder / "grasps")
    info = json_of(capsys, "dataset", "info", dataset, "--json")
    keys = {"attempts", "successes", "excluded", "snapshot", "ref", "schema_version", "bytes", "digest"}
    assert keys <= set(info)
    listed = json_of(capsys, "dataset", "ls", dataset, "--limit", "0", "--json")
    assert info["attempts"] == len(listed) == 40
    assert info["successes"] == sum(row["outcome"] == "held" for row in listed)
    shown = json_of(capsys, "dataset", "show", dataset, listed[7]["attempt"], "--json")
    assert shown["pregrasp_x_m"] == listed[7]["pregrasp_x_m"]
    assert shown["station"]["camera"]["intrinsics"]["width"] == 640
    assert run(["dataset", "show", dataset, listed[7]["attempt"]]) == 0
    assert listed[7]["attempt"] in capsys.readouterr().out


def test_releases_are_addressed_and_immutable(demo_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dataset = str(demo_folder / "grasps")
    assert run(["dataset", "release", dataset, "v1", "-m", "for the test"]) == 0
    assert json_of(capsys, "dataset", "info", f"{dataset}@v1", "--json")["ref"] == "v1"
    assert "v1" in {ref for entry in json_of(capsys, "dataset", "log", dataset, "--json") for ref in entry["refs"]}
    assert run(["dataset", "release", dataset, "v1"]) == 2
    assert "choose another name" in capsys.readouterr().err


def test_evaluate_prints_the_contract(demo_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["evaluate", "--model", str(demo_folder / "run"), "--methods", "random", "--trials", "1", "-w", "1"]
    (row,) = json_of(capsys, *words, "--json")["rows"]
    assert (row["method"], row["objects"], row["trials"]) == ("random", "household-test", 1)


def test_heatmaps_and_servo_runs_are_written(
    demo_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = str(demo_folder / "run")
    heatmaps, picture, trace = tmp_path / "h.rrd", tmp_path / "h.png", tmp_path / "s.rrd"
    shown = ["heatmap", str(demo_folder / "grasps"), "--model", model, "--out", str(heatmaps), "--spacing", "40"]
    told = json_of(capsys, *shown, "-n", "1", "--picture", str(picture), "--json")
    (attempt,) = GraspDataset.open(str(demo_folder / "grasps")).attempts.index[-1:]
    assert (told["recording"], told["picture"], told["attempts"]) == (str(heatmaps), str(picture), [attempt])
    assert told["angles"] == 18
    servoed = ["servo", "--model", model, "--out", str(trace), "--method", "first-order", "--trial", "1"]
    told = json_of(capsys, *servoed, "--json")
    assert (told["recording"], told["method"], told["trial"]) == (str(trace), "first-order", 1)
    assert 0 <= told["predicted_success"] <= 1
    assert isinstance(told["success"], bool)
    assert heatmaps.read_bytes()[:4] == trace.read_bytes()[:4] == b"RRF2"
    drawn = cv2.imread(str(picture))
    assert drawn is not None
    assert drawn.shape[1] == WIDTH_PX


def mistakes(out: Path) -> dict[str, tuple[list[str], str]]:
    """What newcomers type, and what the one line has to say."""
    grasps, model, new = str(out / "grasps"), str(out / "run"), str(out / "new")
    return {
        "no dataset": (["dataset", "info", str(out / "nothing")], "there is no dataset"),
        "no ref": (["dataset", "info", f"{grasps}@v9"], "no release, branch or snapshot 'v9'"),
        "no attempt": (["dataset", "show", grasps, "01ARZ3NDEKTSV4RRFFQ69G5FAV-000000"], "no attempt"),
        "init twice": (["dataset", "init", grasps], "already"),
        "a file for a dataset": (["dataset", "info", str(out / "results.json")], "a file"),
        "a file for a new dataset": (["collect", "sim", str(out / "results.json"), "-n", "1"], "a file"),
        "a file for the demo": (["demo", "--out", str(out / "results.json")], "a file"),
        "a file for a run": (["train", grasps, "--out", str(out / "results.json")], "is a file"),
        "a run for a run": (["train", grasps, "--out", str(out / "run")], "replace it with --overwrite"),
        "another folder for a run": (["train", grasps, "--out", grasps], "holds other files"),
        "objects": (["collect", "sim", new, "--objects", "blorks"], "unknown object set 'blorks'"),
        "negative attempts": (["collect", "sim", new, "-n", "-4"], "attempts is -4"),
        "no workers": (["collect", "sim", new, "-w", "0"], "workers is 0"),
        "more objects than fit": (["collect", "sim", new, "--objects-per-scene", "60"], "no more fit"),
        "more objects than there are": (
            ["collect", "sim", new, "--objects", "household-test", "--objects-per-scene", "11"],
            "has 10 objects",
        ),
        "randomization": (["collect", "sim", new, "--vary", "colours"], "vary is 'colours', expected some of: table"),
        "servo without a network": (["collect", "sim", new, "--policy", "servo"], "--model RUN"),
        "a network for chance": (["collect", "sim", new, "--model", model], "--model goes with --policy servo"),
        "level views of none": (["collect", "sim", new, "--level"], "--level goes with --policy servo"),
        "a method that does not servo": (
            ["collect", "sim", new, "--policy", "servo", "--model", model, "--method", "random"],
            "does not servo",
        ),
        "a share that is none": (
            ["collect", "sim", new, "--policy", "servo", "--model", model, "--random-share", "2"],
            "random_share is 2.0",
        ),
        "session again": (["collect", "sim", grasps, "-n", "40"], "--resume"),
        "methods": (["evaluate", "--model", model, "--methods", "luck"], "unknown servo method 'luck'"),
        "random servo": (["servo", "--model", model, "--method", "random"], "does not servo"),
        "negative trials": (["evaluate", "--model", model, "--trials", "-1"], "trials is -1"),
        "no model": (["evaluate", "--model", grasps], "holds no finished run"),
        "objects to evaluate": (["evaluate", "--model", model, "--objects", "x"], "unknown object set 'x'"),
        "threshold": (["evaluate", "--model", model, "--threshold", "7"], "threshold is 7.0"),
        "negative epochs": (["train", grasps, "--out", new, "--epochs", "-2"], "-2 epochs"),
    }


@pytest.mark.parametrize("name", mistakes(Path()))
def test_mistakes_get_one_line_and_status_2(demo_folder: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    words, said = mistakes(demo_folder)[name]
    before = GraspDataset.open(str(demo_folder / "grasps")).snapshot_id
    check_refused(capsys, words, said)
    assert GraspDataset.open(str(demo_folder / "grasps")).snapshot_id == before
    assert not (demo_folder / "new").exists()


@pytest.mark.parametrize("words", [["--hepl"], ["datasett"], ["collect", "sim"], ["train", "x", "--channels", "uv"]])
def test_usage_errors_have_status_2(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words) == 2
    assert "Usage" in capsys.readouterr().err


@pytest.mark.parametrize("noun", [noun.name for noun in NOUNS])
def test_every_noun_has_help(noun: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([noun, "--help"]) == 0
    assert "Usage" in capsys.readouterr().out


def test_help_loads_nothing_heavy() -> None:
    """The first thing a newcomer types should not take seconds."""
    code = (
        "import sys\n"
        "from handsight.cli.app import run\n"
        "status = run(['--help'])\n"
        "heavy = {'torch', 'pybullet', 'rerun', 'icechunk', 'pandas'} & set(sys.modules)\n"
        "sys.exit(f'loaded {heavy}' if heavy else status)\n"
    )
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "dataset" in done.stdout


def test_collecting_by_chance_and_reading_a_digest_need_no_torch(tmp_path: Path) -> None:
    """Where only data are made, on every worker of a cluster for instance, gigabytes of PyTorch are not needed."""
    code = (
        "import sys\n"
        "sys.modules['torch'] = None  # As if it were not installed.\n"
        "from handsight.cli.app import run\n"
        "sys.exit(run(sys.argv[1:]))\n"
    )
    grasps = str(tmp_path / "grasps")
    collecting = ["collect", "sim", grasps, "-n", "1", "--workers", "1", "--json"]
    for words in (collecting, ["dataset", "info", grasps, "--json"]):
        command = [sys.executable, "-P", "-c", code, *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        told = json.loads(done.stdout)
    assert len(told["digest"]) == 64


def test_the_executable_prints_its_version() -> None:
    executable = Path(sys.executable).with_name("handsight")
    done = subprocess.run([executable, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.strip().count(".") == 2
