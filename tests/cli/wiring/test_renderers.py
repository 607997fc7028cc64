"""``--renderer``: a session names the renderer of its pictures, and going on with it keeps to that."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from handsight.cli.app import run
from handsight.cli.wiring.renderers import with_renderer
from handsight.cli.wiring.resimulate import Resimulator
from handsight.cli.wiring.stations import sim_station
from handsight.collection.errors import RendererUnavailableError
from handsight.collection.sim import renderer as renderer_module
from handsight.collection.sim.renderer import EGL, check_available
from handsight.collection.sim.renderer_choice import RendererChoice
from handsight.datasets import GraspDataset

COLLECT = ("--attempts", "2", "--workers", "1", "--objects", "blocks-test")


def collect(dataset: Path, *words: str) -> int:
    return run(["collect", "sim", str(dataset), *COLLECT, *words])


def renderers_of(dataset: Path) -> list[str]:
    return [session.header.config["station"]["renderer"] for session in GraspDataset.open(str(dataset)).sessions]


@pytest.fixture
def measured_egl(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine on which EGL is much faster; whether it really runs does not matter to who asks."""
    choice = RendererChoice(renderer="egl", tiny_s=0.02, egl_s=0.005, reason="measured")
    monkeypatch.setattr("handsight.cli.wiring.renderers.choose_renderer", lambda _: choice)
    monkeypatch.setattr("handsight.cli.wiring.renderers.check_available", lambda _: None)


def test_by_default_the_bytes_do_not_depend_on_the_machine(tmp_path: Path) -> None:
    assert collect(tmp_path / "grasps") == 0
    assert renderers_of(tmp_path / "grasps") == ["tiny"]


@pytest.mark.usefixtures("measured_egl")
def test_auto_takes_the_faster_one_for_a_new_session(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    factory = with_renderer(sim_station("blocks-test"), "auto", dataset=str(tmp_path / "none"), seed=0)
    assert factory.config == replace(sim_station("blocks-test").config, renderer="egl")
    assert "renderer egl: measured" in capsys.readouterr().err


@pytest.mark.usefixtures("measured_egl")
def test_auto_keeps_to_the_renderer_of_the_session_it_goes_on_with(tmp_path: Path) -> None:
    dataset = tmp_path / "grasps"
    assert collect(dataset) == 0
    assert collect(dataset, "--attempts", "3", "--renderer", "auto", "--resume") == 0
    assert renderers_of(dataset) == ["tiny"]
    assert GraspDataset.open(str(dataset)).info().attempts == 3
    # Another seed or other objects are another session, which is free to choose.
    for factory, seed in ((sim_station("blocks-test"), 1), (sim_station("blocks-train"), 0)):
        assert with_renderer(factory, "auto", dataset=str(dataset), seed=seed).config.renderer == "egl"


def test_a_session_of_egl_is_simulated_again_with_egl(tmp_path: Path) -> None:
    try:
        check_available(EGL)
    except RendererUnavailableError as error:
        pytest.skip(str(error))
    dataset = tmp_path / "grasps"
    assert collect(dataset, "--renderer", "egl") == 0
    assert renderers_of(dataset) == ["egl"]
    recorded = GraspDataset.open(str(dataset))
    (session,) = recorded.sessions
    resimulator = Resimulator()
    again = resimulator(session.header, 1)
    resimulator.close()
    assert again is not None
    assert again.overhead is not None
    stored = recorded.attempt(recorded.attempts.index[1])
    assert stored.overhead is not None
    assert (stored.overhead.rgb == again.overhead.rgb).all()
    assert (stored.overhead.depth == again.overhead.depth).all()


def test_egl_on_a_machine_without_it_is_one_line_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(renderer_module, "_egl_fault", lambda: "no driver")
    assert collect(tmp_path / "grasps", "--renderer", "egl") == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "'egl' does not run on this machine (no driver)" in message
    assert not (tmp_path / "grasps").exists()
