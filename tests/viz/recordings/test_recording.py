"""Recordings as files: there in full, whatever the environment says about logging."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import rerun as rr
import rerun.blueprint as rrb

from handsight.viz.recordings.recording import write_recording


@pytest.mark.parametrize("switch", ["0", "off", "false", None])
def test_a_recording_is_written_with_logging_switched_off(
    switch: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if switch is None:
        monkeypatch.delenv("RERUN", raising=False)
    else:
        monkeypatch.setenv("RERUN", switch)
    path = tmp_path / "said.rrd"
    with write_recording(path, kind="test", name="said", blueprint=rrb.Blueprint()) as recording:
        recording.log("text", rr.TextLog("said"))
    assert path.read_bytes()[:4] == b"RRF2"
    assert os.environ.get("RERUN") == switch
