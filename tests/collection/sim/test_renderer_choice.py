"""EGL is taken only where it runs and is faster."""

from __future__ import annotations

import pytest

from handsight.collection.sim import renderer_choice
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.renderer import Renderer


@pytest.mark.usefixtures("no_egl")
def test_without_egl_tiny_is_chosen_and_nothing_measured() -> None:
    choice = renderer_choice.choose_renderer(SimConfig())
    assert choice.renderer == "tiny"
    assert not choice.measured
    assert "does not run on this machine" in choice.reason


@pytest.mark.parametrize(("tiny_s", "egl_s", "chosen"), [(1.0, 0.85, "egl"), (1.0, 0.95, "tiny"), (1.0, 2.0, "tiny")])
def test_the_faster_one_is_chosen_and_ties_go_to_tiny(
    monkeypatch: pytest.MonkeyPatch, tiny_s: float, egl_s: float, chosen: str
) -> None:
    monkeypatch.setattr(renderer_choice, "check_available", lambda _: None)
    monkeypatch.setattr(renderer_choice, "_time", lambda _: (tiny_s, egl_s))
    assert renderer_choice.choose_renderer(SimConfig()).renderer == chosen


def test_both_are_timed(egl: Renderer) -> None:
    choice = renderer_choice.choose_renderer(SimConfig(objects="blocks-train"))
    assert choice.measured
    assert choice.tiny_s > 0
    assert choice.egl_s > 0
    assert choice.renderer == ("egl" if choice.egl_s <= renderer_choice.GAIN * choice.tiny_s else "tiny")
