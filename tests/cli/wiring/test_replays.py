"""Failed trials in a report: each picture names the call that shows its trial, which happens again as it did."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from tests.support.runs import save_untrained

from handsight.cli.app import run
from handsight.cli.wiring.replays import failure_blocks
from handsight.viz.report.content import Gallery, Note

METHODS = ("cem-1", "global")


@pytest.mark.parametrize("said", [{}, {"level": True}], ids=["older", "levelled"])
def test_a_picture_names_the_call_that_shows_its_trial(
    said: dict[str, bool], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_untrained(tmp_path / "run")
    failed = [
        {"method": method, "number": number, "objects": "blocks-test", "success": False, "aborted": False, "score": 0.5}
        for method in METHODS
        for number in (1, 2)
    ]
    results = {"trials": failed, "gripper": "2f-85", "threshold": 0.9, "seed": 5, **said}
    gallery, *notes = failure_blocks(tmp_path / "run", results, 4)
    assert isinstance(gallery, Gallery)
    assert gallery.command == ""
    unlike = sum(note.text.count("ends otherwise") for note in notes if isinstance(note, Note))
    assert len(gallery.pictures) + unlike == len(failed)
    calls = [shlex.split(one.command) for one in gallery.pictures]
    for call, one in zip(calls, gallery.pictures, strict=True):
        assert ("--level" in call) == bool(said)
        words = [word for word in call if word != "--level"]
        options = dict(zip(words[2::2], words[3::2], strict=True))
        assert one.caption.startswith(f"{options['--method']}, trial {options['--trial']}: S ")
        assert (options["--seed"], options["--threshold"], options["--objects"]) == ("5", "0.9", "blocks-test")
    capsys.readouterr()
    assert run([*calls[-1][1:], "--out", str(tmp_path / "servo.rrd"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert not told["success"]
    assert f": S {told['predicted_success']:.2f}, " in gallery.pictures[-1].caption
