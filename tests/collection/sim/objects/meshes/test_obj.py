"""Wavefront text: what is legal is read as it was meant, and anything else is refused with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.support.meshes import pyramid

from handsight.collection.sim.objects.meshes.fault import MeshFault
from handsight.collection.sim.objects.meshes.mesh_file import check_mesh
from handsight.collection.sim.objects.meshes.obj import read_obj

TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n"
FACES = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def volume_m3(folder: Path, text: str) -> float:
    (folder / "one.obj").write_text(text)
    return check_mesh(folder / "one.obj", root=folder, scale=1.0).solid.volume_m3


@pytest.mark.parametrize(
    "text",
    [
        TETRAHEDRON + FACES,
        TETRAHEDRON.replace(" ", "\t") + FACES.replace(" ", "\t"),
        "\ufeff" + (TETRAHEDRON + FACES).replace("\n", "\r\n"),
        TETRAHEDRON + FACES.replace("f 1 3 2", "f 1 \\\n3 2"),
        TETRAHEDRON + FACES.replace("f 1 3 2", "f 1 3 2 # the bottom"),
        TETRAHEDRON + "f -4 -2 -3\nf -4 -3 -1\nf -3 -2 -1\nf -4 -1 -2\n",
        # A place that is relative to what stands above the face, not to the whole file.
        "v 9 9 9\nv 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf -3 -1 -2\nv 0 0 0.1\nf -4 -3 -1\nf -3 -2 -1\nf -4 -1 -2\n",
        TETRAHEDRON.replace("0.1", "1.0D-1") + FACES,
        FACES + TETRAHEDRON,
        TETRAHEDRON + "vn 0 0 nan\n" + FACES.replace("f 1 3 2", "f 1//1 3//1 2//1"),
        "fancy things\n" + TETRAHEDRON + FACES,
    ],
    ids=["plain", "tabs", "mark", "continued", "comment", "end", "above", "fortran", "below", "normals", "unknown"],
)
def test_legal_text_is_read_as_it_was_meant(tmp_path: Path, text: str) -> None:
    if "nan" in text:
        (tmp_path / "one.obj").write_text(text)
        mesh = check_mesh(tmp_path / "one.obj", root=tmp_path, scale=1.0, plain=True)
        assert mesh.solid.volume_m3 == pytest.approx(0.1**3 / 6)
    else:
        assert volume_m3(tmp_path, text) == pytest.approx(0.1**3 / 6)


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("v 0.1 0", "line 5: a vertex has 2 numbers, expected 3"),
        ("v 0.02500000999999990000 -0.04", "line 5: a vertex has 2 numbers, expected 3"),
        ("v 0 0 x", "line 5: a vertex holds 'x', expected a number"),
        ("v 0 0 1_0", "line 5: a vertex holds '1_0', expected a number"),
        ("v 0 0 inf", "line 5: a vertex holds 'inf', expected a finite number"),
        ("v 0 0 1e400", "line 5: a vertex holds '1e400', expected a finite number"),
        ("v 0 0 \x1b[31m", r"line 5: a vertex holds '\\\\x1b"),
        ("f", "line 5: a face has 0 corners, expected 3 to 1000"),
        ("f 1 2", "line 5: a face has 2 corners"),
        ("f" + " 1" * 1001, "line 5: a face has 1001 corners"),
        ("f 0 1 2", "line 5: a face names vertex 0, expected 1 and more"),
        ("f 1 2 5", "line 5: a face names vertex 5, and the file has 4"),
        ("f 1 2 -5", "line 5: a face names vertex -5, expected 1 and more, or -4 to -1"),
        ("f 1 2 " + "9" * 5000, "line 5: a face names vertex '9999"),
        ("f 1 2 999999999999999", "line 5: a face names vertex 999999999999999"),
        ("f 1.5 2 3", "line 5: a face names vertex '1.5'"),
        ("f 1/2/3/4 2 3", "line 5: a face has corner '1/2/3/4'"),
        ("vt nan 0", "line 5: a texture coordinate holds 'nan'.*--plain"),
        ("f 1/7 2/7 3/7", "line 5: a face names texture coordinate 7, and the file has 0; pass --plain"),
    ],
)
def test_a_line_that_makes_no_sense_is_named(line: str, fault: str) -> None:
    with pytest.raises(MeshFault, match=fault):
        read_obj((TETRAHEDRON + line + "\n" + FACES).encode(), plain=False)


def test_looks_that_make_no_sense_are_left_out_on_request() -> None:
    text = read_obj((TETRAHEDRON + "vt nan 0\nf 1/7 2/1 3/1\n").encode(), plain=True).text
    assert text.splitlines()[-1] == "f 1 2 3"


@pytest.mark.no_cover
def test_text_without_end_is_refused_before_memory_is() -> None:
    with pytest.raises(MeshFault, match="is vertex 500001, expected at most 500000"):
        read_obj(b"v 0 0 0\n" * 500_001, plain=False)
    with pytest.raises(MeshFault, match="line 100003: has more than 100000 triangles"):
        read_obj(b"v 0 0 0\n" + b"f 1 1 1\n" * 100_002, plain=False)
    with pytest.raises(MeshFault, match="has more than 4000000 lines"):
        read_obj(b"\n" * 4_000_001, plain=False)


def test_faces_of_many_corners_become_fans() -> None:
    corners = "".join(f"v {np.cos(k)} {np.sin(k)} 0\n" for k in range(6))
    lines = read_obj((corners + "f 1 2 3 4 5 6\n").encode(), plain=False).text.splitlines()
    assert lines[-4:] == ["f 1 2 3", "f 1 3 4", "f 1 4 5", "f 1 5 6"]


def test_faces_of_one_material_name_the_same_things() -> None:
    """Readers take the first face of a material for all of it."""
    text = pyramid().decode().replace("f 1/1 4/2 3/3", "f 1 4 3")
    assert [line for line in read_obj(text.encode(), plain=False).text.splitlines() if line.startswith("f ")] == [
        "f 1 3 2",
        "f 1 2 4",
        "f 2 3 4",
        "f 1 4 3",
    ]
