"""Recorded heatmaps, read back: at every angle every score lies on the pixel for which it was computed."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from tests.support.rrd import Content, at, decode, read_recording, scalars, verify

from handsight.evaluation.foresight import Foresight, most_wrong, reliability_rows
from handsight.evaluation.temperature import Temperature
from handsight.servoing.heatmap import Heatmap
from handsight.viz import palette
from handsight.viz.errors import RecordingError
from handsight.viz.examples import ForesightOverview, HeatmapExample
from handsight.viz.heat_look import angle_rgba, axial_deg, muted
from handsight.viz.recordings.encoding import SCORE_UNITS
from handsight.viz.recordings.heatmap_layouts import HEAT_TIMELINE, key_of
from handsight.viz.recordings.heatmaps import write_heatmaps

MOVING = (
    "picture/heat",
    "picture/contour/line",
    "picture/jaws/line",
    "picture/turn/jaws/line",
    "picture/turn/text",
    "picture/text",
    "scores",
    "table/jaws",
    "plots/best",
    "plots/threshold",
)
STILL = (
    "picture/rgb",
    "picture/muted",
    "picture/shaded",
    "picture/highest/heat",
    "picture/highest/contour/line",
    "picture/best/jaws/line",
    "picture/angles",
    "picture/strokes/line",
    "picture/scale",
    "picture/hues",
    "depth",
    "input/rgb",
    "input/height",
    "text",
)


@pytest.fixture(scope="module")
def overview() -> ForesightOverview:
    seen = [
        Foresight(
            attempt=f"S-{number:06d}", target="set/cup", held=number % 3 == 0, raw=0.1 * number, score=0.1 * number
        )
        for number in range(10)
    ]
    return ForesightOverview(
        title="Predicted against happened",
        wrong=most_wrong(seen),
        thumbnails=[np.full((60, 80, 3), 20 * number, np.uint8) for number in range(6)],
        reliability=reliability_rows(seen),
        attempts=len(seen),
        learnt=4,
        temperature=Temperature(value=1.5, attempts=12, source="held out"),
    )


@pytest.fixture(scope="module")
def heatmaps_path(
    examples: list[HeatmapExample], overview: ForesightOverview, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    path = tmp_path_factory.mktemp("heatmaps") / "heatmaps.rrd"
    write_heatmaps(path, examples, overview)
    return path


@pytest.fixture(scope="module")
def content(heatmaps_path: Path) -> Content:
    return read_recording(heatmaps_path, timeline=HEAT_TIMELINE)


def maps_by_turn(example: HeatmapExample) -> dict[int, Heatmap]:
    """The maps of an example by their place on the slider."""
    return {axial_deg(angle): example.maps.at(at) for at, angle in enumerate(example.maps.angles_rad.tolist())}


def test_every_entity_is_there_at_every_angle(content: Content, examples: list[HeatmapExample]) -> None:
    for number, example in enumerate(examples):
        turns = sorted(maps_by_turn(example))
        for entity in MOVING:
            for name, rows in content[f"{key_of(number)}/{entity}"].items():
                if not name.startswith("Series"):
                    assert [time for time, _ in rows] == turns, (entity, name)
        for entity in STILL:
            for rows in content[f"{key_of(number)}/{entity}"].values():
                assert [time for time, _ in rows] == [None], entity


def test_no_slider_goes_below_zero_where_the_viewer_draws_no_picture(examples: list[HeatmapExample]) -> None:
    turns = sorted(maps_by_turn(examples[0]))
    assert turns == [0, 30, 60, 90, 120, 150]


def test_rerun_finds_nothing_wrong_with_the_file(heatmaps_path: Path) -> None:
    result = verify(heatmaps_path)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("entity", ["picture/heat", "picture/highest/heat", "picture/angles"])
def test_grid_points_lie_on_their_raw_pixels(content: Content, examples: list[HeatmapExample], entity: str) -> None:
    """Rerun puts the centre of pixel j of an image at j + 1/2: so do the overlay's cells and the picture's pixels."""
    for number, example in enumerate(examples):
        components = content[f"{key_of(number)}/{entity}"]
        for (_, scale), (_, offset) in zip(
            components["Transform3D:scale"], components["Transform3D:translation"], strict=True
        ):
            for axis, points_px in enumerate((example.maps.columns_px, example.maps.rows_px)):
                drawn_px = scale[0][axis] * (np.arange(len(points_px)) + 0.5) + offset[0][axis]
                np.testing.assert_allclose(drawn_px, points_px + 0.5, atol=1e-3)


def test_overlays_have_the_colour_of_each_score_at_each_angle(content: Content, examples: list[HeatmapExample]) -> None:
    for number, example in enumerate(examples):
        blobs = content[f"{key_of(number)}/picture/heat"]["EncodedImage:blob"]
        for turn, heatmap in maps_by_turn(example).items():
            np.testing.assert_array_equal(decode(at(blobs, turn)[0]), palette.overlay_rgba(heatmap.scores))
        highest = content[f"{key_of(number)}/picture/highest/heat"]["EncodedImage:blob"][0][1][0]
        np.testing.assert_array_equal(decode(highest), palette.overlay_rgba(example.maps.best))
        angles = content[f"{key_of(number)}/picture/angles"]["EncodedImage:blob"][0][1][0]
        np.testing.assert_array_equal(decode(angles), angle_rgba(example.maps.best_angle_rad, example.maps.best))


def test_scores_come_back_as_numbers(content: Content, examples: list[HeatmapExample]) -> None:
    for number, example in enumerate(examples):
        blobs = content[f"{key_of(number)}/scores"]["EncodedDepthImage:blob"]
        for turn, heatmap in maps_by_turn(example).items():
            read = decode(at(blobs, turn)[0]) / SCORE_UNITS
            np.testing.assert_allclose(read, heatmap.scores, atol=1e-5)


def test_the_contour_is_where_the_scores_cross_the_threshold(content: Content, examples: list[HeatmapExample]) -> None:
    """At each of its points the score between the grid's points is the threshold, on the scale that is shown."""
    crossed = 0
    for number, example in enumerate(examples):
        strips = content[f"{key_of(number)}/picture/contour/line"]["LineStrips2D:strips"]
        for turn, heatmap in maps_by_turn(example).items():
            lines = [np.array(line) - 0.5 for line in at(strips, turn) or []]
            above = bool((heatmap.scores >= example.shown_threshold).any())
            assert bool(lines) == above
            for line in lines:
                column = np.interp(line[:, 0], heatmap.columns_px, np.arange(len(heatmap.columns_px)))
                row = np.interp(line[:, 1], heatmap.rows_px, np.arange(len(heatmap.rows_px)))
                low, high = (edge(row).astype(int) for edge in (np.floor, np.ceil))
                left, right = (edge(column).astype(int) for edge in (np.floor, np.ceil))
                around = np.stack([heatmap.scores[r, c] for r in (low, high) for c in (left, right)])
                assert (around.min(axis=0) <= example.shown_threshold + 1e-3).all()
                assert (around.max(axis=0) >= example.shown_threshold - 1e-3).all()
                crossed += 1
    assert crossed


def test_the_jaws_stand_on_the_best_score_turned_as_the_slider_says(
    content: Content, examples: list[HeatmapExample]
) -> None:
    for number, example in enumerate(examples):
        strips = content[f"{key_of(number)}/picture/jaws/line"]["LineStrips2D:strips"]
        for turn, heatmap in maps_by_turn(example).items():
            left, right = np.array(at(strips, turn)[2])
            row, column = np.unravel_index(heatmap.scores.argmax(), heatmap.scores.shape)
            best_px = (heatmap.columns_px[column] + 0.5, heatmap.rows_px[row] + 0.5)
            np.testing.assert_allclose(0.5 * (left + right), best_px, atol=1e-3)
            along = right - left
            assert axial_deg(math.atan2(along[1], along[0])) == turn


def test_the_plot_has_the_best_score_of_each_angle_and_the_threshold(
    content: Content, examples: list[HeatmapExample]
) -> None:
    for number, example in enumerate(examples):
        best = dict(scalars(content, f"{key_of(number)}/plots/best"))
        assert best == {turn: float(one.scores.max()) for turn, one in maps_by_turn(example).items()}
        assert set(dict(scalars(content, f"{key_of(number)}/plots/threshold")).values()) == {example.shown_threshold}


def test_heat_lies_over_the_muted_picture_in_three_dimensions(content: Content, examples: list[HeatmapExample]) -> None:
    """Where no heat is the surface has the colour of the muted picture, and it stands where depth was measured."""
    for number, example in enumerate(examples):
        surface = content[f"{key_of(number)}/table/surface"]
        points_m = np.array(surface["Mesh3D:vertex_positions"][0][1])
        colours = np.array(at(surface["Mesh3D:vertex_colors"], 0), dtype=np.uint32)
        rgb = np.stack([colours >> 24 & 255, colours >> 16 & 255, colours >> 8 & 255], axis=-1)
        k = example.view.camera.intrinsics
        depth_m = example.view.plane_m - points_m[:, 2]
        column = (points_m[:, 0] - example.view.camera.x_tool_camera_m) * k.fx / depth_m + k.cx
        row = (-points_m[:, 1] - example.view.camera.y_tool_camera_m) * k.fy / depth_m + k.cy
        at_px = (np.rint(row).astype(int), np.rint(column).astype(int))
        np.testing.assert_allclose(depth_m, example.view.depth_m[at_px], atol=1e-5)
        cold = maps_by_turn(example)[0]
        heat = (
            np.interp(row, cold.rows_px, np.arange(len(cold.rows_px))),
            np.interp(column, cold.columns_px, np.arange(len(cold.columns_px))),
        )
        near = cold.scores[np.rint(heat[0]).astype(int), np.rint(heat[1]).astype(int)]
        bare = near < 1e-3
        assert bare.any()
        assert np.abs(rgb[bare].astype(int) - muted(example.view.rgb)[at_px][bare]).mean() < 2


def test_the_text_says_what_is_shown_and_how_to_read_it(content: Content, examples: list[HeatmapExample]) -> None:
    before, after = (content[f"{key_of(at)}/text"]["TextDocument:text"][0][1][0] for at in range(2))
    assert "### before" in before
    assert "not calibrated: not fitted" in before
    assert "crop by crop" in before  # A function has no dense form.
    assert "attempted grasp" not in before
    assert "calibrated S (temperature 2.00, fitted on 50 attempts made up)" in after
    assert f"**{examples[1].maps.best.max():.3f}**" in after
    assert f"| threshold | {examples[1].shown_threshold:.2f}, which is 0.80 as the network gives it |" in after
    assert "predicted S" in after


def test_the_overview_lists_the_most_wrong_first(content: Content, overview: ForesightOverview) -> None:
    text = content["/overview/list"]["TextDocument:text"][0][1][0]
    lines = [line for line in text.splitlines() if line.startswith("| ") and "S-" in line]
    assert [line.split(" | ")[1] for line in lines] == [one.attempt for one in overview.wrong]
    assert "10 attempts, 4 of them learnt from" in text
    assert "temperature 1.50" in text
    sheet = decode(content["/overview/sheet"]["EncodedImage:blob"][0][1][0])
    assert sheet.shape == (2 * (60 + 22 + 8), 4 * (80 + 8), 3)
    assert abs(int(sheet[30, 4 * 88 - 44].mean()) - 60) < 4  # the fourth thumbnail


def test_faults_are_reported_together_and_nothing_is_written(examples: list[HeatmapExample], tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no examples"):
        write_heatmaps(tmp_path / "none.rrd", [])
    maps = examples[0].maps
    unfit = dataclasses.replace(examples[0], maps=dataclasses.replace(maps, rows_px=maps.rows_px[1:]))
    broken = np.full_like(maps.scores, np.nan)
    unknown = dataclasses.replace(examples[1], maps=dataclasses.replace(maps, scores=broken))
    with pytest.raises(RecordingError, match=r"example 0 \('before'\).*shape.*example 1 \('after'\).*no numbers"):
        write_heatmaps(tmp_path / "bad.rrd", [unfit, unknown])
    turned = dataclasses.replace(examples[1], maps=dataclasses.replace(maps, angles_rad=maps.angles_rad + 0.1))
    with pytest.raises(RecordingError, match="different angles"):
        write_heatmaps(tmp_path / "bad.rrd", [examples[0], turned])
    assert list(tmp_path.iterdir()) == []
