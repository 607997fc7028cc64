"""``handsight servo`` watched, and ``handsight view trace``, as their user meets them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from tests.support.rrd import colours, read_picture

from handsight.cli.app import run
from handsight.servoing.homography import InputGrid
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.run import DataOrigin, save_run
from handsight.training.settings import TrainSettings
from handsight.viz.recordings.viewer_process import free_port


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trace") / "run"
    origin = DataOrigin(dataset="none", ref="main", snapshot="", digest="", view="overhead", attempts=0)
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(0)
        network = GraspQualityNetwork(GqnConfig())
    save_run(folder, network, origins=[origin], grid=InputGrid(), settings=TrainSettings())
    return folder


@pytest.fixture(scope="module")
def trace(model: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("trace") / "servo.rrd"
    assert run(["servo", "--model", str(model), "--method", "cem-1", "--trial", "1", "--out", str(out)]) == 0
    return out


@pytest.mark.parametrize("way", ["no display", "nobody listens"])
def test_a_servo_run_goes_on_where_nobody_can_watch(
    model: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    way: str,
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    watched = ["--live"] if way == "no display" else ["--live-url", f"rerun+http://127.0.0.1:{free_port()}/proxy"]
    out = tmp_path / "servo.rrd"
    assert run(["servo", "--model", str(model), "--method", "cem-1", "--out", str(out), *watched, "--json"]) == 0
    told = capfd.readouterr()
    assert json.loads(told.out)["recording"] == str(out)
    assert out.is_file()
    (line,) = (line for line in told.err.splitlines() if "warning" in line)
    assert "goes on without" in line


def test_a_viewer_of_our_own_and_another_are_not_both_asked_for(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    for command in ("servo", "evaluate"):
        words = [command, "--model", str(model), "--live", "--live-url", "rerun+http://127.0.0.1:9876/proxy"]
        assert run(words) == 2
        assert "expected one of them" in capsys.readouterr().err
        assert run([command, "--model", str(model), "--live-url", "http://localhost:9876"]) == 2
        assert "expected one such as rerun+http://127.0.0.1:9876/proxy" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_step_is_drawn_into_a_file(trace: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    picture = tmp_path / "step.png"
    status = run(["view", "trace", str(trace), "--picture", str(picture), "--step", "2", "--json"])
    shown = capsys.readouterr()
    if "found no Vulkan driver" in shown.err:
        pytest.skip(shown.err.strip())
    assert status == 0
    assert json.loads(shown.out) == {"recording": str(trace), "name": "cem-1-000001", "picture": str(picture)}
    assert colours(read_picture(picture)) > 3000


def test_a_file_that_is_none_is_refused_in_a_line(
    trace: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(trace.read_bytes()[:5000])
    assert run(["view", "trace", str(cut), "--picture", str(tmp_path / "x.png")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("was cut off before its end; record it again with this handsight")
    assert not (tmp_path / "x.png").exists()
