"""How much a PLY or STL file asks for, looked at before anything is allocated for it."""

from __future__ import annotations

import re
import struct

from handsight.collection.sim.objects.meshes.fault import MAX_TRIANGLES, MeshFault
from handsight.collection.sim.objects.meshes.obj import MAX_ROWS
from handsight.datasets.errors import counted

MAX_TEXT_BYTES = 64_000_000
"""Twice what the largest mesh takes that is written as text; text takes several times its size to read."""
_STL_HEADER = struct.Struct("<80sI")
_STL_TRIANGLE_BYTES = 50
_PLY_HEADER_BYTES = 100_000
_ELEMENT = re.compile(rb"^element[ \t]+(\S+)[ \t]+(\S+)[ \t\r]*$", re.MULTILINE)
_MOST = {"vertex": MAX_ROWS, "face": MAX_TRIANGLES}
_MOST_OTHERS = MAX_ROWS
_SPARE_LINES = 1000
"""Empty lines at the end, and the header's own end."""


def check_text_size(content: bytes) -> None:
    """Refuse text that no mesh of a permitted size needs.

    Raises:
        MeshFault: With the reason.
    """
    if len(content) > MAX_TEXT_BYTES:
        raise MeshFault(
            f"the file has {len(content) / 1e6:.0f} MB of text, expected at most {MAX_TEXT_BYTES / 1e6:.0f} MB; "
            "decimate it, or save it as binary"
        )


def check_stl(content: bytes) -> None:
    """Refuse an STL file of too many triangles.

    Raises:
        MeshFault: With the reason.
    """
    count = _STL_HEADER.unpack_from(content)[1] if len(content) >= _STL_HEADER.size else 0
    if len(content) != _STL_HEADER.size + count * _STL_TRIANGLE_BYTES:
        check_text_size(content)
        count = content.lower().count(b"vertex") // 3
    if count > MAX_TRIANGLES:
        raise MeshFault(f"has {count} triangles, expected at most {MAX_TRIANGLES}; decimate it")


def check_ply(content: bytes) -> None:
    """Refuse a PLY file whose header asks for too much, or for other than what follows it.

    Raises:
        MeshFault: With the reason.
    """
    header, end, _ = content[:_PLY_HEADER_BYTES].partition(b"end_header")
    if not end:
        raise MeshFault("cannot be read, its header has no end; it is cut off, or no PLY file")
    rows = 0
    for name, count in _ELEMENT.findall(header):
        what = name.decode(errors="replace")
        most = _MOST.get(what, _MOST_OTHERS)
        if not count.isdigit() or len(count) > len(str(most)) or int(count) > most:
            shown_count = count.decode(errors="replace")[:20]
            raise MeshFault(f"declares {shown_count} of element {what[:40]!r}, expected 0 to {most}; decimate it")
        rows += int(count)
    if b"ascii" in header.partition(b"element")[0]:
        check_text_size(content)
        _check_lines(content[len(header) :], rows)


def _check_lines(body: bytes, rows: int) -> None:
    lines = body.count(b"\n") or body.count(b"\r")
    if lines < rows:
        raise MeshFault(f"is cut off: its header declares {counted(rows, 'line')}, and {lines} follow")
    if lines > rows + _SPARE_LINES:
        raise MeshFault(f"holds {counted(lines, 'line')} where its header declares {rows}")
