"""A report as one HTML file, which fetches nothing.

The page has no script, its pictures are ``data:`` URIs, and its content security policy forbids everything else, so
that it opens offline and tells nobody that it was opened. The same report gives the same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from handsight.datasets.atomic import write_text
from handsight.datasets.writable import file_fault
from handsight.viz.errors import ReportError
from handsight.viz.report.content import Report, Section

SUFFIXES = (".html", ".htm")
TOP_LEVEL = 2
"""Headings of the sections; that of the page is 1."""
_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ufffe\uffff\ud800-\udfff]")
"""Characters that HTML has no place for; names and reasons may hold them."""


def check_report_path(path: Path) -> None:
    """Refuse a place where no report can be written, before one is made.

    Raises:
        ReportError: The name does not end in ``.html``, or the disk takes no such file.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ReportError(f"cannot write a report to {str(path)!r}, expected a name that ends in .html")
    if (fault := file_fault(path)) is not None:
        raise ReportError(f"cannot write a report to {str(path)!r}: {fault}; choose another file")


def write_report(report: Report, path: Path) -> int:
    """Write a report, whole or not at all; returns its size in bytes.

    Raises:
        ReportError: It cannot be written there.
    """
    check_report_path(path)
    text = report_html(report)
    write_text(path, text)
    return len(text.encode())


def report_html(report: Report) -> str:
    """The page."""
    template = _environment().get_template("page.html.j2")
    ids = _Ids(report)
    text = template.render(report=report, id_of=ids.of, fresh_id=ids.fresh, top=TOP_LEVEL)
    return _UNPRINTABLE.sub("\ufffd", text)


class _Ids:
    """Ids of what is on the page: numbers in order of appearance, each thing its own."""

    def __init__(self, report: Report) -> None:
        self._given = 0
        # The sections live as long as the report, so that nothing else has their identity.
        self._sections = {id(section): self.fresh() for section in sections_of(report)}

    def of(self, section: Section) -> str:
        """The id of a section; the same in the contents and at its place."""
        return self._sections[id(section)]

    def fresh(self) -> str:
        """An id that nothing has."""
        self._given += 1
        return f"part-{self._given}"


def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("handsight.viz.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def sections_of(report: Report) -> Iterator[Section]:
    """All sections, with their parts, in the order of the page."""
    stack = list(reversed(report.sections))
    while stack:
        section = stack.pop()
        yield section
        stack += reversed(section.parts)
