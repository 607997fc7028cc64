"""``handsight view heatmap`` and ``handsight heatmap`` as their user meets them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tests.support.lab import make_lab
from tests.support.rrd import colours, read_picture, read_recording
from tests.support.runs import save_untrained

from handsight.cli.app import run
from handsight.viz.recordings.heatmap_layouts import HEAT_TIMELINE


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    save_untrained(tmp_path / "run")
    return Path(str(make_lab(tmp_path / "lab").path))


def heatmaps(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, object]:
    capsys.readouterr()
    assert run(["heatmap", "lab", "--model", "run", "--angles", "4", *words, "--json"]) == 0
    told: dict[str, object] = json.loads(capsys.readouterr().out)
    return told


def test_the_most_wrong_of_those_that_match_are_recorded_at_all_angles(
    lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = heatmaps(capsys, "--wrong", "-n", "2", "--where", "target == 'duck' or target == 'egg'")
    compared = told["compared"]
    assert isinstance(compared, list)
    surprises = [1 - one["score"] if one["held"] else one["score"] for one in compared]
    assert surprises == sorted(surprises, reverse=True)
    assert {one["target"] for one in compared} <= {"duck", "egg"}
    assert told["attempts"] == [one["attempt"] for one in compared[:2]]
    assert told["calibrated"] is False
    content = read_recording(Path("heatmaps.rrd"), timeline=HEAT_TIMELINE)
    for number in range(2):
        times = [time for time, _ in content[f"/{number:03d}/scores"]["EncodedDepthImage:blob"]]
        assert times == [0, 45, 90, 135]
    assert "/002/scores" not in content
    assert compared[0]["attempt"] in content["/overview/list"]["TextDocument:text"][0][1][0]


def test_attempts_are_taken_as_named_or_the_latest(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    named = heatmaps(capsys, "-n", "3", "--where", "success or not success")
    assert named["angles"] == 4
    attempts = named["attempts"]
    assert isinstance(attempts, list)
    again = heatmaps(capsys, *attempts[::-1], "--picture", "strip.png")
    assert again["attempts"] == attempts[::-1]
    assert colours(read_picture(Path("strip.png"))) > 50


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--where", "number > 99"), "no attempt with an overhead picture matches"),
        (("3", "--wrong"), "would choose others"),
        (("--where", "nonsense"), "nonsense"),
        (("--angles", "181"), "less than or equal to 180"),
        (("--threshold", "2"), "threshold is 2"),
    ],
)
@pytest.mark.parametrize("command", [("heatmap",), ("view", "heatmap")])
def test_what_cannot_be_shown_is_said_in_a_line(
    lab: Path, capsys: pytest.CaptureFixture[str], command: tuple[str, ...], words: tuple[str, ...], said: str
) -> None:
    more = ("--picture", "x.png") if command[0] == "view" else ()
    assert run([*command, "lab", "--model", "run", *words, *more]) == 2
    assert said in capsys.readouterr().err
    assert not list(Path().glob("*.rrd")) + list(Path().glob("*.png"))


def test_without_a_screen_the_way_to_look_is_named_before_there_is_anything_to_do(
    lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["view", "heatmap", "lab", "--model", "run"]) == 2
    said = capsys.readouterr().err
    assert "there is no display" in said
    assert "--picture FILE.png" in said


def test_it_is_drawn_into_a_file_and_nothing_else_is_left(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = run(
        ["view", "heatmap", "lab", "--model", "run", "-n", "1", "--angles", "2", "--picture", "x.png", "--json"]
    )
    shown = capsys.readouterr()
    if "found no Vulkan driver" in shown.err:
        pytest.skip(shown.err.strip())
    assert status == 0
    assert json.loads(shown.out)["picture"] == "x.png"
    assert colours(read_picture(Path("x.png"))) > 300
    assert not list(Path().glob("*.rrd"))
