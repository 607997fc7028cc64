from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image
from tests.support.reports import make_demo

from handsight.viz.errors import ReportError
from handsight.viz.report import folder
from handsight.viz.report.content import Figure, Note, Table
from handsight.viz.report.folder import files_section, folder_contents


def test_everything_that_the_demo_leaves_is_found(tmp_path: Path) -> None:
    made = make_demo(tmp_path / "demo")
    found = folder_contents(made)
    assert [path.name for path in (*found.datasets, *found.runs, *found.recordings)] == [
        "grasps",
        "run",
        "servo_trace.rrd",
    ]
    assert [path.name for path, _ in found.evaluations] == ["results.json"]
    section = files_section(found)
    assert section is not None
    (table,) = section.parts[0].blocks
    assert isinstance(table, Table)
    assert table.rows[0][2] == f"rerun {made / 'servo_trace.rrd'}"


def test_pictures_are_taken_in_and_what_is_none_is_said(tmp_path: Path) -> None:
    Image.new("RGB", (20, 10)).save(tmp_path / "a.png")
    (tmp_path / "b.png").write_text("no picture")
    (tmp_path / ".hidden.png").write_text("no picture")
    section = files_section(folder_contents(tmp_path))
    assert section is not None
    picture, note = section.parts[0].blocks
    assert isinstance(picture, Figure)
    assert isinstance(note, Note)
    assert "b.png is no picture" in note.text


def test_a_folder_of_nothing_and_one_of_too_much_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    (tmp_path / "other.json").write_text("[]")
    with pytest.raises(ReportError, match="holds nothing that a report can tell of"):
        folder_contents(tmp_path)
    monkeypatch.setattr(folder, "MOST_ENTRIES", 1)
    with pytest.raises(ReportError, match="holds 2 entries, expected at most 1"):
        folder_contents(tmp_path)
