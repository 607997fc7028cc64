"""Recorded heatmaps, read back: every score lies on the pixel for which it was computed."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from tests.support.rrd import Content, at, decode, read_recording, verify

from handsight.viz import palette
from handsight.viz.errors import RecordingError
from handsight.viz.examples import HeatmapExample
from handsight.viz.recordings.heatmaps import write_heatmaps

TIMELINE = "example"
ENTITIES = {
    "/picture/rgb",
    "/picture/heat",
    "/picture/jaws/line",
    "/picture/text",
    "/depth",
    "/scores/grid",
    "/input/rgb",
    "/input/height",
    "/text/example",
}


@pytest.fixture(scope="module")
def heatmaps_path(examples: list[HeatmapExample], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("heatmaps") / "heatmaps.rrd"
    write_heatmaps(path, examples)
    return path


@pytest.fixture(scope="module")
def content(heatmaps_path: Path) -> Content:
    return read_recording(heatmaps_path, timeline=TIMELINE)


def test_every_entity_is_there_for_every_example(content: Content, examples: list[HeatmapExample]) -> None:
    for entity in ENTITIES:
        for rows in content[entity].values():
            assert [time for time, _ in rows] == list(range(len(examples)))


def test_rerun_finds_nothing_wrong_with_the_file(heatmaps_path: Path) -> None:
    result = verify(heatmaps_path)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("entity", ["/picture/heat", "/scores/grid"])
def test_grid_points_lie_on_their_raw_pixels(content: Content, examples: list[HeatmapExample], entity: str) -> None:
    """Rerun puts the centre of pixel j of an image at j + 1/2: so do the overlay's cells and the picture's pixels."""
    for k, example in enumerate(examples):
        scale = np.array(at(content[entity]["Transform3D:scale"], k)[0])
        translation_px = np.array(at(content[entity]["Transform3D:translation"], k)[0])
        for axis, points_px in enumerate((example.heatmap.columns_px, example.heatmap.rows_px)):
            cell_centres = np.arange(len(points_px)) + 0.5
            drawn_px = scale[axis] * cell_centres + translation_px[axis]
            np.testing.assert_allclose(drawn_px, points_px + 0.5, atol=1e-3)


def test_each_cell_of_the_overlay_rests_on_its_pixel_and_they_cover_the_picture(
    content: Content, examples: list[HeatmapExample]
) -> None:
    camera, heatmap = examples[0].view.camera.intrinsics, examples[0].heatmap
    scale = at(content["/picture/heat"]["Transform3D:scale"], 0)[0]
    offset = at(content["/picture/heat"]["Transform3D:translation"], 0)[0]
    sides = ((heatmap.columns_px, camera.width), (heatmap.rows_px, camera.height))
    for axis, (places_px, side_px) in enumerate(sides):
        centres_px = offset[axis] + scale[axis] * (np.arange(len(places_px)) + 0.5)
        np.testing.assert_allclose(centres_px, places_px + 0.5, atol=1e-3)
        # The lattice is centred: at either side less than a cell is left over.
        assert abs(offset[axis]) < scale[axis]
        assert abs(offset[axis] + scale[axis] * len(places_px) - side_px) < scale[axis]


def test_the_overlay_has_the_colour_of_each_score(content: Content, examples: list[HeatmapExample]) -> None:
    for k, example in enumerate(examples):
        rgba = decode(at(content["/picture/heat"]["EncodedImage:blob"], k)[0])
        np.testing.assert_array_equal(rgba, palette.overlay_rgba(example.heatmap.scores))


def test_scores_come_back_as_numbers(content: Content, examples: list[HeatmapExample]) -> None:
    for k, example in enumerate(examples):
        raw = np.array(at(content["/scores/grid"]["DepthImage:buffer"], k)[0], dtype=np.uint8)
        np.testing.assert_array_equal(raw.view(np.float32), example.heatmap.scores.ravel())


def test_the_jaws_stand_on_the_best_score(content: Content, examples: list[HeatmapExample]) -> None:
    for k, example in enumerate(examples):
        left, right = np.array(at(content["/picture/jaws/line"]["LineStrips2D:strips"], k)[2])
        row, column = np.unravel_index(example.heatmap.scores.argmax(), example.heatmap.scores.shape)
        best_px = (example.heatmap.columns_px[column] + 0.5, example.heatmap.rows_px[row] + 0.5)
        np.testing.assert_allclose(0.5 * (left + right), best_px, atol=1e-3)


def test_the_text_gives_title_score_and_label(content: Content, examples: list[HeatmapExample]) -> None:
    texts = [at(content["/text/example"]["TextDocument:text"], k)[0] for k in range(len(examples))]
    assert "## before" in texts[0]
    assert "grasp here" not in texts[0]
    assert f"| grasp here | {'held' if examples[1].held else 'empty'} |" in texts[1]
    assert f"{examples[1].heatmap.scores.max():.3f}" in texts[1]


def test_faults_are_reported_together_and_nothing_is_written(examples: list[HeatmapExample], tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no examples"):
        write_heatmaps(tmp_path / "none.rrd", [])
    heatmap = examples[0].heatmap
    unfit = dataclasses.replace(examples[0], heatmap=dataclasses.replace(heatmap, rows_px=heatmap.rows_px[1:]))
    broken = np.full_like(heatmap.scores, np.nan)
    unknown = dataclasses.replace(examples[1], heatmap=dataclasses.replace(heatmap, scores=broken))
    with pytest.raises(RecordingError, match=r"example 0 \('before'\).*shape.*example 1 \('after'\).*no numbers"):
        write_heatmaps(tmp_path / "bad.rrd", [unfit, unknown])
    assert list(tmp_path.iterdir()) == []
