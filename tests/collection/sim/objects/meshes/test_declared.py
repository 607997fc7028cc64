"""What the headers of PLY and STL files declare, before memory is given to it."""

from __future__ import annotations

import struct

import pytest

from handsight.collection.sim.objects.meshes.declared import check_ply, check_stl
from handsight.collection.sim.objects.meshes.fault import MeshFault

HEADER = b"ply\nformat binary_little_endian 1.0\nelement vertex %b\nelement face 1\nend_header\n"


@pytest.mark.parametrize("count", [b"500001", b"-1", b"9" * 5000, b"1e3", b"nan"])
def test_a_ply_header_that_declares_an_absurd_count_is_refused(count: bytes) -> None:
    with pytest.raises(MeshFault, match="of element 'vertex', expected 0 to 500000"):
        check_ply(HEADER % count)


def test_headers_without_end_and_bodies_of_other_lengths_are_refused() -> None:
    with pytest.raises(MeshFault, match="its header has no end"):
        check_ply(b"ply\n" * 1000)
    text = b"ply\nformat ascii 1.0\nelement vertex 5\nend_header\n"
    with pytest.raises(MeshFault, match="is cut off: its header declares 5 lines, and 2 follow"):
        check_ply(text + b"0 0 0\n")
    with pytest.raises(MeshFault, match="holds 3001 lines where its header declares 5"):
        check_ply(text + b"0 0 0\n" * 3000)


def test_too_many_triangles_are_refused_unread() -> None:
    with pytest.raises(MeshFault, match="has 100001 triangles"):
        check_stl(bytes(80) + struct.pack("<I", 100_001) + bytes(50 * 100_001))
    with pytest.raises(MeshFault, match="has 100001 triangles"):
        check_stl(b"solid\n" + b"vertex 0 0 0\n" * 300_003)
    with pytest.raises(MeshFault, match="has 64 MB of text, expected at most 64 MB"):
        check_stl(b"solid\n" + bytes(64_000_000))
