"""Pictures inside a page: of bounded size, and equal for equal content."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from handsight.viz.errors import ReportError
from handsight.viz.figures.style import STYLE, save_figure
from handsight.viz.report import embedding
from handsight.viz.report.embedding import embedded_file, embedded_png, embedded_rgb, embedded_svg


def draw(path: Path) -> None:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(3.0, 2.0), dpi=100)
        figure.add_subplot().plot([1, 2], [2, 1])
        save_figure(figure, path)


def test_a_figure_keeps_its_text_and_size() -> None:
    embedded = embedded_svg(draw)
    assert (embedded.width_px, embedded.height_px) == (288, 192)
    head, _, content = embedded.uri.partition(",")
    assert head == "data:image/svg+xml;base64"
    assert b"</svg>" in base64.b64decode(content)
    assert embedded == embedded_svg(draw)


def test_photographs_are_made_smaller_and_never_larger() -> None:
    rgb = np.random.default_rng(0).integers(0, 255, (300, 400, 3), dtype=np.uint8)
    small, as_it_is = embedded_rgb(rgb, width_px=100), embedded_rgb(rgb, width_px=1000)
    assert (small.width_px, small.height_px) == (100, 75)
    assert (as_it_is.width_px, as_it_is.height_px) == (400, 300)
    assert len(small.content) < len(as_it_is.content) < rgb.nbytes / 2
    assert embedded_png(draw).media_type == "image/jpeg"


def test_a_file_is_laid_on_white(tmp_path: Path) -> None:
    Image.new("RGBA", (20, 10), (0, 0, 0, 0)).save(tmp_path / "clear.png")
    embedded = embedded_file(tmp_path / "clear.png", width_px=10)
    with Image.open(io.BytesIO(embedded.content)) as picture:
        assert picture.size == (10, 5)
        assert picture.getpixel((3, 3)) == (255, 255, 255)


def test_what_is_no_picture_or_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(ReportError, match=r"text\.png is no picture"):
        embedded_file(tmp_path / "text.png", width_px=10)
    with pytest.raises(ReportError, match="is no picture"):
        embedded_file(tmp_path / "missing.png", width_px=10)
    Image.new("RGB", (40, 30)).save(tmp_path / "large.png")
    whole = (tmp_path / "large.png").read_bytes()
    (tmp_path / "cut.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ReportError, match="is no picture"):
        embedded_file(tmp_path / "cut.png", width_px=10)
    monkeypatch.setattr(embedding, "MOST_PIXELS", 1000)
    with pytest.raises(ReportError, match="40 x 30 pixels, expected at most 1000"):
        embedded_file(tmp_path / "large.png", width_px=10)


def test_a_figure_without_a_size_is_refused() -> None:
    with pytest.raises(ReportError, match="has no size"):
        embedded_svg(lambda path: path.write_text("<svg></svg>"))
