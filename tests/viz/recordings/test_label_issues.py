"""Recorded label issues, read back: the grasp lies where it was attempted, the text says what was recorded."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.rrd import Content, at, colours, decode, read_picture, read_recording, verify

from handsight.evaluation.label_issues import LabelIssue
from handsight.evaluation.trial import TrialRecording
from handsight.viz import palette
from handsight.viz.errors import NoVulkanError, RecordingError
from handsight.viz.examples import LabelIssueExample
from handsight.viz.pixels import PictureFrame
from handsight.viz.recordings.label_issues import TIMELINE, shown_bounds, write_label_issues
from handsight.viz.recordings.screenshot import save_screenshots

ENTITIES = {
    "/picture/rgb",
    "/picture/depth",
    "/picture/jaws/line",
    "/picture/text",
    "/input/rgb",
    "/input/height",
    "/text/issue",
}


@pytest.fixture(scope="module")
def issues(trial: TrialRecording) -> list[LabelIssueExample]:
    """Two attempts on the pictures of a servo run: an unlikely success without truth, an unlikely failure with it."""
    views = [trial.trace.steps[index].view for index in (0, -1)]
    inputs = [trial.trace.steps[index].inputs.numpy(force=True).astype(np.float16) for index in (0, -1)]
    facts: list[dict[str, Any]] = [
        {
            "success": True,
            "predicted_success": 0.03,
            "label_quality": 0.03,
            "truth_held": None,
            "truth_disagrees": None,
        },
        {
            "success": False,
            "predicted_success": 0.91,
            "label_quality": 0.09,
            "truth_held": True,
            "truth_disagrees": True,
        },
    ]
    return [
        LabelIssueExample(
            issue=LabelIssue(
                attempt=f"01M82D0ES98VNXTNKDRF7H092G-{number:06d}", target="blocks-train/003", **facts[number]
            ),
            view=views[number],
            grasp=(0.03 - 0.05 * number, 0.02, 0.6),
            inputs=inputs[number],
            jaws_m=0.085,
            widths_m=(0.085, 0.0213, 0.0213, 0.0 if number else math.nan),
            closed_width_m=0.002,
            commands=(f"handsight dataset relabel grasps {number}", f"handsight dataset exclude grasps {number}"),
        )
        for number in range(2)
    ]


@pytest.fixture(scope="module")
def path(issues: list[LabelIssueExample], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("issues") / "issues.rrd"
    write_label_issues(path, issues)
    return path


@pytest.fixture(scope="module")
def content(path: Path) -> Content:
    return read_recording(path, timeline=TIMELINE)


def test_every_entity_is_there_for_every_issue(content: Content) -> None:
    for entity in ENTITIES:
        for rows in content[entity].values():
            assert [time for time, _ in rows] == [0, 1]


def test_rerun_finds_nothing_wrong_with_the_file(path: Path) -> None:
    result = verify(path)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_jaws_lie_where_the_grasp_was_attempted(content: Content, issues: list[LabelIssueExample]) -> None:
    for k, example in enumerate(issues):
        camera, plane_m = example.view.camera, example.view.plane_m
        dx_m, dy_m, angle_rad = example.grasp
        x_m, y_m = dx_m - camera.x_tool_camera_m, dy_m - camera.y_tool_camera_m
        # The centre of pixel (0, 0) is at (0.5, 0.5) in Rerun.
        centre_px = np.array(
            [
                camera.intrinsics.fx * x_m / plane_m + camera.intrinsics.cx + 0.5,
                camera.intrinsics.fy * y_m / plane_m + camera.intrinsics.cy + 0.5,
            ]
        )
        strips = [np.array(strip) for strip in at(content["/picture/jaws/line"]["LineStrips2D:strips"], k)]
        assert len(strips) == 3 if k == 0 else len(strips) > 3, "dashed where the grasp failed"
        left, right = strips[2][0], strips[-1][1]
        np.testing.assert_allclose(0.5 * (left + right), centre_px, atol=1e-2)
        along = (right - left) / np.linalg.norm(right - left)
        np.testing.assert_allclose(along, [math.cos(angle_rad), math.sin(angle_rad)], atol=1e-3)
        assert np.linalg.norm(right - left) == pytest.approx(0.085 * camera.intrinsics.fx / plane_m, rel=1e-3)


def test_the_jaws_have_the_colour_of_the_label(content: Content) -> None:
    for k, (red, green, blue) in enumerate([palette.HELD, palette.EMPTY]):
        packed = at(content["/picture/jaws/line"]["LineStrips2D:colors"], k)[0]
        assert packed >> 8 == red << 16 | green << 8 | blue


def test_pictures_come_back(content: Content, issues: list[LabelIssueExample]) -> None:
    for k, example in enumerate(issues):
        rgb = decode(at(content["/picture/rgb"]["EncodedImage:blob"], k)[0])
        assert np.abs(rgb.astype(int) - example.view.rgb).mean() < 3
        depth_mm = decode(at(content["/picture/depth"]["EncodedDepthImage:blob"], k)[0])
        np.testing.assert_allclose(depth_mm, 1e3 * example.view.depth_m, atol=0.51)
        read = decode(at(content["/input/rgb"]["EncodedImage:blob"], k)[0])
        np.testing.assert_allclose(read, 255 * example.inputs[:3].astype(float).transpose(1, 2, 0), atol=0.51)
        height_m = np.array(at(content["/input/height"]["DepthImage:buffer"], k)[0], dtype=np.uint8).view(np.float32)
        np.testing.assert_allclose(height_m, np.maximum(-example.inputs[3].astype(np.float32), 0).ravel())


def test_the_text_says_what_was_recorded_and_what_to_type(content: Content, issues: list[LabelIssueExample]) -> None:
    first, second = (at(content["/text/issue"]["TextDocument:text"], k)[0] for k in range(2))
    assert first.startswith(f"## 1 of 2 · {issues[0].issue.attempt}\n")
    for part in (
        "**success**",
        "| predicted success S | 0.030 |",
        "| label quality | 0.030 |",
        "blocks-train/003",
        "85.0 → 21.3 → 21.3 → — mm",
        "2.0 mm",
    ):
        assert part in first
    assert "simulator" not in first
    assert "| simulator | object held, disagrees with the label |" in second
    for text, example in zip((first, second), issues, strict=True):
        for command in example.commands:
            assert f"```\n{command}\n```" in text


def test_the_overview_lists_them_all_at_every_time(content: Content, issues: list[LabelIssueExample]) -> None:
    ((time, (text,)),) = content["/text/all"]["TextDocument:text"]
    assert time is None
    rows = text.splitlines()[2:]
    assert [example.issue.attempt in row for example, row in zip(issues, rows, strict=True)] == [True, True]
    assert "disagrees" in rows[1]


def test_grasps_beside_the_picture_are_shown_and_others_leave_it_whole(issues: list[LabelIssueExample]) -> None:
    def ranges(examples: list[LabelIssueExample]) -> tuple[list[float], list[float]]:
        shown = shown_bounds(examples).range
        assert shown is not None
        (bounds,) = shown.as_arrow_array().to_pylist()
        return bounds["x_range"], bounds["y_range"]

    k = issues[0].view.camera.intrinsics
    assert ranges(issues) == ([0, k.width], [0, k.height])
    beside = dataclasses.replace(issues[0], grasp=(0.0, 0.25, 0.0))
    (left, right), (top, bottom) = ranges([issues[1], beside])
    assert (left, right, top) == (0, k.width, 0)
    frame = PictureFrame(camera=beside.view.camera, plane_m=beside.view.plane_m)
    lowest_px = max(strip[:, 1].max() for strip in frame.jaws(beside.grasp, beside.jaws_m))
    assert lowest_px > k.height
    assert lowest_px < bottom < lowest_px + 40


def test_faults_are_reported_together_and_nothing_is_written(issues: list[LabelIssueExample], tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no label issues"):
        write_label_issues(tmp_path / "none.rrd", [])
    flat, three = (dataclasses.replace(issues[0], inputs=issues[0].inputs[part]) for part in (0, slice(3)))
    with pytest.raises(RecordingError, match=r"\(64, 64\), expected.*\(3, 64, 64\), expected"):
        write_label_issues(tmp_path / "bad.rrd", [flat, three])
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(RecordingError, match="there is no folder"):
        write_label_issues(tmp_path / "none" / "x.rrd", issues)


def test_every_issue_draws(path: Path, tmp_path: Path) -> None:
    shots = {0: tmp_path / "first.png", 1: tmp_path / "second.png"}
    try:
        save_screenshots(path, shots, timeline=TIMELINE)
    except NoVulkanError as error:
        pytest.skip(str(error))
    first, second = (read_picture(shot) for shot in shots.values())
    for picture in (first, second):
        height, width = picture.shape[:2]
        # Pictures above, input and text below: none of them may be blank.
        assert colours(picture[: height // 2, : width // 2]) > 2000
        assert colours(picture[: height // 2, width // 2 :]) > 100
        assert colours(picture[int(0.7 * height) :, : int(0.35 * width)]) > 500
        assert colours(picture[int(0.7 * height) :, int(0.45 * width) :]) > 30
    assert np.abs(first.astype(int) - second).mean() > 1
