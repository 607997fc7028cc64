"""Files are told apart before a viewer opens them."""

from __future__ import annotations

from pathlib import Path

import pytest

from handsight.viz.errors import RecordingError
from handsight.viz.recordings.recorded_file import read_recorded_file
from handsight.viz.recordings.servo_trace import KIND


def test_a_trace_is_known_by_its_kind(trace_path: Path) -> None:
    found = read_recorded_file(trace_path, kind=KIND, what="a servo trace")
    assert (found.kind, found.name) == (KIND, "cem-1-000004")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (lambda whole: b"hello", "is no recording"),
        (lambda whole: b"", "is no recording"),
        (lambda whole: whole[: len(whole) // 2], "was cut off before its end; record it again"),
        (lambda whole: b"RRF1" + whole[4:], "written by a Rerun before 0.23"),
        (
            lambda whole: whole[:4] + bytes([0, 99]) + whole[6:],
            r"written by Rerun 0\.99, expected Rerun 0\.41 or older",
        ),
        (lambda whole: whole[:-60] + bytes(60), "is damaged|was cut off|holds no recording"),
    ],
    ids=["words", "empty", "cut off", "old", "newer", "spoilt"],
)
def test_what_is_no_recording_of_ours_is_refused_in_a_line(
    trace_path: Path, tmp_path: Path, changed: object, said: str
) -> None:
    path = tmp_path / "x.rrd"
    path.write_bytes(changed(trace_path.read_bytes()))  # type: ignore[operator]
    with pytest.raises(RecordingError, match=said) as refusal:
        read_recorded_file(path, kind=KIND, what="a servo trace")
    assert "\n" not in str(refusal.value)


def test_another_kind_and_no_file_are_refused(trace_path: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"shows 'handsight_servo_trace', expected heatmaps .*rerun "):
        read_recorded_file(trace_path, kind="handsight_heatmaps", what="heatmaps")
    with pytest.raises(RecordingError, match="there is no recording"):
        read_recorded_file(tmp_path / "none.rrd", kind=KIND, what="a servo trace")
