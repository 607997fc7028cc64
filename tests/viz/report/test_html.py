"""Pages, taken apart: nothing is fetched, nothing is run, and everything has a name that can be read out."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from tests.support.html_page import HtmlPage
from tests.support.reports import MARKUP

from handsight.viz.errors import ReportError
from handsight.viz.report.content import Facts, Figure, Gallery, Note, Points, Report, Section, Table
from handsight.viz.report.embedding import Embedded, embedded_rgb
from handsight.viz.report.html import report_html, sections_of, write_report

SMALL = embedded_rgb(np.full((6, 8, 3), 90, np.uint8), width_px=8)
WIDE = dataclasses.replace(SMALL, width_px=900, height_px=300)


def make_figure(text: str, picture: Embedded = SMALL) -> Figure:
    return Figure(picture=picture, alt=text, caption=text, command=text)


def make_report(text: str = "a name") -> Report:
    """Every kind of block, with the same text wherever there is one."""
    gallery = Gallery(title=text, text=text, pictures=(make_figure(text), make_figure(text)), command=text)
    table = Table(caption=text, head=(text, text), rows=((text, text), (text, text)), command=text)
    blocks = (
        Facts(rows=((text, text),)),
        Note(text=text, command=text),
        Points(texts=(text, text)),
        table,
        dataclasses.replace(table, folded=True, prose=frozenset({1})),
        make_figure(text),
        make_figure(text, WIDE),
        gallery,
        dataclasses.replace(gallery, title=""),
    )
    # Two sections on two levels each, with parts of their own.
    parts = [Section(title=text, blocks=blocks) for _ in range(4)]
    sections = tuple(Section(title=f"{text} {at}", blocks=blocks, parts=tuple(parts[at : at + 2])) for at in (0, 2))
    return Report(title=text, summary=text, command=text, handsight="0", sections=sections)


def test_a_page_has_landmarks_headings_names_and_nothing_outside_it() -> None:
    page = HtmlPage(report_html(make_report()))
    assert page.faults() == []
    assert "default-src 'none'" in page.all("meta")[1]["content"]
    assert len(page.all("figure")) == 2 * 3 * 6
    assert len(page.all("th")) == 2 * 3 * 2 * 4


def test_names_are_text_whatever_they_hold() -> None:
    page = HtmlPage(report_html(make_report(MARKUP)))
    assert page.faults() == []
    assert all(found["alt"] == MARKUP for found in page.all("img"))
    assert not any(name.startswith("on") for _, found in page.elements for name in found)
    assert " ".join(page.words).count("{{ 7 * 7 }}") > 20


def test_characters_that_html_lacks_are_replaced() -> None:
    text = report_html(make_report("a\x00b\x1bc\x85d\ud800e"))
    assert "a\ufffdb\ufffdc\ufffdd\ufffde" in text
    text.encode()


def test_equal_reports_are_equal_byte_by_byte(tmp_path: Path) -> None:
    size = write_report(make_report(), tmp_path / "one.html")
    write_report(make_report(), tmp_path / "two.html")
    one = (tmp_path / "one.html").read_bytes()
    assert len(one) == size
    assert one == (tmp_path / "two.html").read_bytes()
    write_report(make_report("other"), tmp_path / "two.html")
    assert one != (tmp_path / "two.html").read_bytes()


def test_sections_come_in_the_order_of_the_page() -> None:
    tree = Section(title="1", parts=(Section(title="2", parts=(Section(title="3"),)), Section(title="4")))
    report = Report(title="", summary="", command="", handsight="", sections=(tree, Section(title="5")))
    assert [section.title for section in sections_of(report)] == ["1", "2", "3", "4", "5"]


@pytest.mark.parametrize(
    ("name", "said"),
    [("report.pdf", "ends in .html"), ("missing/report.html", "there is no folder"), ("here.html", "is a folder")],
)
def test_a_place_that_takes_no_page_is_refused(name: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "here.html").mkdir()
    with pytest.raises(ReportError, match=said):
        write_report(make_report(), tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["here.html"]
