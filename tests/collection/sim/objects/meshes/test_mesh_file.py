"""Hostile, broken and odd mesh files: each is named with its fault, and nothing is changed."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from tests.support.meshes import block, cuboid, glb_of, inverted, png, pyramid, refused_import, row_of_blocks, stl

from handsight.collection.errors import MeshImportError
from handsight.collection.sim.objects.meshes.importer import import_folder
from handsight.collection.sim.objects.meshes.mesh_file import check_mesh
from handsight.collection.sim.objects.meshes.plan import ImportSettings

PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
0.1 0 0
0 0.1 0
3 0 1 {corner}
"""
LIBRARIES = {
    "lost.mtl": "newmtl m\nmap_Kd gone.png\n",
    "up.mtl": "newmtl m\nmap_Kd ../../../../../etc/passwd\n",
    "rooted.mtl": "newmtl m\nmap_Kd /etc/passwd\n",
    "web.mtl": "newmtl m\nmap_Kd http://127.0.0.1:9/texture.png\n",
    "windows.mtl": "newmtl m\nmap_Kd C:\\textures\\fine.png\n",
    "bomb.mtl": "newmtl m\nmap_Kd bomb.png\n",
    "large.mtl": "newmtl m\nmap_Kd large.png\n",
    "cut.mtl": "newmtl m\nmap_Kd cut.png\n",
    "words.mtl": "newmtl m\nmap_Kd words.png\n",
}
PICTURES = {
    "bomb.png": png(60_000, 60_000),
    "large.png": png(9000, 9000),
    "cut.png": png(500, 500),
    "words.png": b"no picture",
}
BAD: dict[str, tuple[bytes, str]] = {
    # Broken.
    "truncated.stl": (stl(block())[:400], "has no triangles; it is empty, cut off, or of another format"),
    "truncated.glb": (glb_of()[:-40], "cannot be read"),
    "garbage.stl": (np.random.default_rng(1).bytes(5000), "has no triangles"),
    "garbage.ply": (np.random.default_rng(2).bytes(5000), "cannot be read"),
    "garbage.obj": (np.random.default_rng(3).bytes(5000), "has no triangles|cannot be read"),
    "garbage.glb": (np.random.default_rng(4).bytes(5000), "is no binary glTF file"),
    "not-finite.obj": (
        pyramid().replace(b"v 0 0 0.1", b"v 0 0 nan"),
        "line 4: a vertex holds .nan., expected a finite number",
    ),
    "beyond.obj": (b"v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 9\n", "line 4: a face names vertex 9, and the file has 3"),
    "beyond.ply": (PLY.format(corner=77).encode(), "1 of 1 triangles name vertices beyond the 3 it has"),
    "count.stl": (bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(200), "has no triangles"),
    # Empty.
    "nothing.obj": (b"", "the file is empty"),
    "one-point.obj": (b"v 0 0 0\nf 1 1 1\n", "0 x 0 x 0 m"),
    "slivers.obj": (b"v 0 0 0\nv 0.1 0 0\nf 1 2 1\n", "every triangle has two corners in one place"),
    # Huge.
    "accessor.glb": (
        glb_of(accessors=[{"count": 2**40, "componentType": 5126, "type": "VEC3"}]),
        "accessor of 1099511",
    ),
    "far.obj": (pyramid().replace(b"0.1", b"1e300"), r"is 1e\+300 x"),
    "rows.ply": (
        PLY.format(corner=2).replace("vertex 3", "vertex 99999999999").encode(),
        "of element 'vertex', expect",
    ),
    "lines.ply": (PLY.format(corner=2).replace("vertex 3", "vertex 30").encode(), "declares 31 lines, and"),
    "short.ply": (PLY.format(corner=2).replace("face 1", "face 0").encode() + b"\n" * 2000, "lines where its header"),
    "half-a-number.ply": (PLY.format(corner=2).replace("0.1 0 0", "0.1 0 0x").encode(), "cannot be read"),
    "many.stl": (
        bytes(80) + struct.pack("<I", 100_001) + bytes(50 * 100_001),
        "has 100001 triangles, expected at most",
    ),
    # No solid.
    "open.ply": (PLY.format(corner=2).encode(), "is not watertight: 3 of 3 edges"),
    "sheet.stl": (stl(trimesh.creation.box(extents=(0.1, 0.1, 0.0))), "encloses next to no volume"),
    "foil.stl": (stl(trimesh.creation.box(extents=(0.1, 0.1, 1e-5))), "it is 0.01 mm thick on average"),
    "thirteen.stl": (stl(row_of_blocks(13)), "consists of 13 bodies, expected at most 12"),
    "apart.stl": (stl(block() + block(x_m=0.2)), "consists of 2 parts that do not touch"),
    # Companions.
    "no-library.obj": (pyramid("gone.mtl"), "names 'gone.mtl', which is missing"),
    "library-up.obj": (pyramid("../../../../../../etc/passwd"), "etc/passwd', which is outside the folder"),
    "library-web.obj": (pyramid("https://127.0.0.1:9/x.mtl"), "which is outside the folder"),
    "lost.obj": (pyramid("lost.mtl"), "names 'gone.png', which is missing.*--plain"),
    "up.obj": (pyramid("up.mtl"), "which is outside the folder"),
    "rooted.obj": (pyramid("rooted.mtl"), "names '/etc/passwd', which is outside the folder"),
    "web.obj": (pyramid("web.mtl"), "which is outside the folder"),
    "windows.obj": (pyramid("windows.mtl"), "which is outside the folder"),
    "bomb.obj": (pyramid("bomb.mtl"), "is a picture of far more than 8192 x 8192 pixels"),
    "large.obj": (pyramid("large.mtl"), "is a picture of 9000 x 9000 pixels"),
    "cut.obj": (pyramid("cut.mtl"), "is a picture that cannot be read"),
    "words.obj": (pyramid("words.mtl"), "is no picture of kind"),
    "texture-up.ply": (
        PLY.format(corner=2).replace("1.0\n", "1.0\ncomment TextureFile /etc/passwd\n", 1).encode(),
        "names '/etc/passwd', which is outside the folder",
    ),
    "coordinates.obj": (pyramid(last_uv="nan 1"), "line 7: a texture coordinate holds .nan.*--plain"),
    "buffer.glb": (glb_of(buffers=[{"uri": "gone.bin", "byteLength": 36}]), "names 'gone.bin', which is missing"),
    "buffer-up.glb": (glb_of(buffers=[{"uri": "../../../../../etc/passwd", "byteLength": 36}]), "outside the folder"),
    "picture.glb": (glb_of(images=[{"uri": "data:image/png;base64,AAAA"}]), "its picture 0 is no picture of kind"),
    "accessors.glb": (
        glb_of(accessors=[{"count": 10**6, "componentType": 5126, "type": "VEC3"}] * 11),
        "accessors of 11000000 rows together",
    ),
    "name.glb": (glb_of(nodes=[{"mesh": 0, "name": "\ud800"}]), "characters that are none"),
    "nodes.glb": (glb_of(nodes=[{"mesh": 0}] * 2001), "has 2001 nodes, expected at most 2000"),
    # Loops.
    "loop.glb": (glb_of(nodes=[{"children": [1]}, {"children": [0], "mesh": 0}]), "its nodes form no tree"),
    "side-loop.glb": (glb_of(nodes=[{}, {"children": [2]}, {"children": [1]}]), "its nodes form no tree"),
    "nonsense.glb": (glb_of(nodes=[{"children": 5}]), "its description makes no sense"),
}


def write_bad(folder: Path) -> None:
    for name, text in LIBRARIES.items():
        (folder / name).write_text(text)
    for name, content in {**PICTURES, **{name: content for name, (content, _) in BAD.items()}}.items():
        (folder / name).write_bytes(content)


def test_every_bad_mesh_is_named_with_its_fault(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_bad(meshes)
    (meshes / "good.stl").write_bytes(stl(block()))
    with (meshes / "bytes.stl").open("wb") as file:
        file.truncate(200_000_001)
    first, *lines = refused_import(capsys, meshes)
    faults = {**{name: fault for name, (_, fault) in BAD.items()}, "bytes.stl": "has 200 MB, expected at most 200 MB"}
    assert first.startswith(f"error: {len(faults)} of {len(faults) + 1} meshes in {meshes} cannot be used")
    said = dict(line.strip().split(": ", 1) for line in lines)
    assert said.keys() == faults.keys()
    assert {name: said[name] for name, fault in faults.items() if not re.search(fault, said[name])} == {}


@given(inside_out=st.booleans(), offset=st.floats(-1, 1), extents=st.tuples(*[st.floats(0.011, 0.4)] * 3))
def test_the_faces_of_what_is_seen_look_outwards(
    tmp_path_factory: pytest.TempPathFactory, inside_out: bool, offset: float, extents: tuple[float, float, float]
) -> None:
    box = trimesh.creation.box(extents=extents)
    box.apply_translation((offset, -offset, 2 * offset))
    folder = tmp_path_factory.mktemp("boxes")
    (folder / "box.stl").write_bytes(stl(inverted(box) if inside_out else box))
    mesh = check_mesh(folder / "box.stl", root=folder, scale=1.0)
    away = np.einsum("ij,ij->i", mesh.looks.face_normals, mesh.looks.triangles_center - mesh.looks.bounds.mean(axis=0))
    assert (away > 0).all()
    assert mesh.solid.volume_m3 == pytest.approx(np.prod(extents), rel=1e-3)


def test_millimetres_become_metres(meshes: Path) -> None:
    mesh = cuboid()
    mesh.apply_transform(np.diag([1000.0, 1000.0, 1000.0, 1.0]))
    mesh.export(meshes / "cup.stl")
    with pytest.raises(MeshImportError, match=r"is 60 x 50 x 40 m.*in millimetres, pass --scale 0\.001"):
        import_folder(meshes, "cups")
    (entry,) = import_folder(meshes, "cups", settings=ImportSettings(scale=0.001)).objects
    assert entry.size_m == pytest.approx((0.06, 0.05, 0.04), abs=1e-4)
    assert entry.scale == 0.001


def test_a_mesh_without_units_is_told_a_scale(meshes: Path) -> None:
    trimesh.creation.box(extents=(0.001, 0.002, 0.001)).export(meshes / "dummy.ply")
    with pytest.raises(MeshImportError, match=r"--scale 75 would make it 0\.15 m long"):
        import_folder(meshes, "specks")
