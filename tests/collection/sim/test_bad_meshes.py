"""Hostile, broken and odd mesh files at the command line: one clear message, exit status 2, nothing changed."""

from __future__ import annotations

import json
import os
import re
import signal
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from handsight.cli.app import run
from handsight.cli.output import Bar
from handsight.collection.errors import MeshImportError
from handsight.collection.sim.engine import connect
from handsight.collection.sim.objects import load_object_set
from handsight.collection.sim.objects.cache import CACHE_VARIABLE, cache_root
from handsight.collection.sim.objects.meshes.decomposition import Cutter
from handsight.collection.sim.objects.meshes.fault import MeshFault
from handsight.collection.sim.objects.meshes.importer import carry_out, import_folder
from handsight.collection.sim.objects.meshes.mesh_file import check_mesh
from handsight.collection.sim.objects.meshes.plan import ImportSettings, plan_import
from handsight.collection.sim.objects.meshes.solid import Solid, make_solid


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    folder = tmp_path / "meshes"
    folder.mkdir()
    return folder


def block(side_m: float = 0.05, x_m: float = 0.0) -> trimesh.Trimesh:
    """A cube; CoACD is done with it at once."""
    cube: trimesh.Trimesh = trimesh.creation.box(extents=(side_m,) * 3)
    cube.apply_translation((x_m, 0, 0))
    return cube


def inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.invert()
    return mesh


def row_of_blocks(count: int) -> trimesh.Trimesh:
    """Cubes so close that they count as touching."""
    row = block(0.02)
    for number in range(1, count):
        row += block(0.02, x_m=0.0205 * number)
    return row


def stl(mesh: trimesh.Trimesh) -> bytes:
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def pyramid(library: str = "", *, last_uv: str = "0 1", last_corner: str = "4/3") -> bytes:
    """A closed Wavefront file with texture coordinates."""
    corners = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n"
    coordinates = f"vt 0 0\nvt 1 0\nvt {last_uv}\n"
    faces = f"usemtl m\nf 1/1 3/2 2/3\nf 1/1 2/2 4/3\nf 2/1 3/2 {last_corner}\nf 1/1 4/2 3/3\n"
    return (f"mtllib {library}\n" * bool(library) + corners + coordinates + faces).encode()


def png(width: int, height: int) -> bytes:
    """A picture that claims a size and holds next to nothing."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    pixels = chunk(b"IDAT", zlib.compress(bytes(1000)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + pixels + chunk(b"IEND", b"")


def glb(description: dict[str, Any], binary: bytes = b"") -> bytes:
    text = json.dumps(description).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def glb_of(**changes: Any) -> bytes:
    """One mesh of three corners, with some of the description changed."""
    accessor = {"count": 3, "componentType": 5126, "type": "VEC3", "bufferView": 0}
    description = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [accessor],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
    }
    return glb({**description, **changes}, bytes(36))


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
    "not-finite.obj": (pyramid().replace(b"v 0 0 0.1", b"v 0 0 nan"), "2 of 8 vertices are not finite"),
    "beyond.obj": (b"v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 9\n", "cannot be read .IndexError"),
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
    "coordinates.obj": (pyramid(last_uv="nan 1"), "texture coordinates that are missing or not finite"),
    "buffer.glb": (glb_of(buffers=[{"uri": "gone.bin", "byteLength": 36}]), "names 'gone.bin', which is missing"),
    "buffer-up.glb": (glb_of(buffers=[{"uri": "../../../../../etc/passwd", "byteLength": 36}]), "outside the folder"),
    "picture.glb": (glb_of(images=[{"uri": "data:image/png;base64,AAAA"}]), "its picture 0 is no picture of kind"),
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


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *words: str) -> list[str]:
    """The lines of a refusal, which must end with status 2 and leave the cache as it is."""
    before = sorted(cache_root().rglob("*"))
    assert run(["objects", "import", str(folder), "--name", "mine", *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("error: ")
    assert sorted(cache_root().rglob("*")) == before
    return said.err.splitlines()


def test_every_bad_mesh_is_named_with_its_fault(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_bad(meshes)
    (meshes / "good.stl").write_bytes(stl(block()))
    with (meshes / "bytes.stl").open("wb") as file:
        file.truncate(200_000_001)
    first, *lines = refused(capsys, meshes)
    faults = {**{name: fault for name, (_, fault) in BAD.items()}, "bytes.stl": "has 200 MB, expected at most 200 MB"}
    assert first.startswith(f"error: {len(faults)} of {len(faults) + 1} meshes in {meshes} cannot be used")
    said = dict(line.strip().split(": ", 1) for line in lines)
    assert said.keys() == faults.keys()
    assert {name: said[name] for name, fault in faults.items() if not re.search(fault, said[name])} == {}


def test_links_out_of_the_folder_are_not_followed(
    meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "secret.stl").write_bytes(stl(block()))
    (meshes / "out.stl").symlink_to(tmp_path / "secret.stl")
    (meshes / "nowhere.stl").symlink_to(tmp_path / "gone.stl")
    (meshes / "round.stl").symlink_to(meshes / "round.stl")
    (meshes / "inside.stl").write_bytes(stl(block()))
    (meshes / "same.stl").symlink_to(meshes / "inside.stl")
    (meshes / "skin.png").symlink_to("/etc/passwd")
    (meshes / "skin.mtl").write_text("newmtl m\nmap_Kd skin.png\n")
    (meshes / "skinned.obj").write_bytes(pyramid("skin.mtl"))
    (meshes / "round.mtl").symlink_to(meshes / "round.mtl")
    (meshes / "rounded.obj").write_bytes(pyramid("round.mtl"))
    first, *lines = refused(capsys, meshes)
    assert "5 of 7 meshes" in first
    said = dict(line.strip().split(": ", 1) for line in lines)
    assert said.keys() == {"out.stl", "nowhere.stl", "round.stl", "skinned.obj", "rounded.obj"}
    assert said["rounded.obj"].startswith("names 'round.mtl', which is a link that leads nowhere")
    assert said["out.stl"].startswith("is a link out of the folder")
    assert said["nowhere.stl"].startswith("is a link that leads nowhere")
    assert said["skinned.obj"].startswith("names 'skin.png', which is outside the folder")


def test_names_that_become_one_or_none(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ["my cup.stl", "my-cup.stl", "manifest.json.stl", "x" * 210 + ".stl", "\x1b[31mred.stl", "good.stl"]
    for name in names:
        (meshes / name).write_bytes(stl(block()))
    Path(os.fsdecode(os.fsencode(meshes) + b"/\xff.stl")).write_bytes(stl(block()))
    (meshes / "._good.stl").write_bytes(b"what a Mac packs beside every file")
    first, *lines = refused(capsys, meshes)
    assert "4 of 7 meshes" in first
    assert "my-cup.stl: gives object 'my-cup' a second time, after my cup.stl; rename one of them" in "\n".join(lines)
    assert any("which is the name of the set's own manifest" in line for line in lines)
    assert any("gives an object name of 210 bytes" in line for line in lines)
    assert any(line.strip().startswith("\\udcff.stl: has a name that is not UTF-8") for line in lines)
    assert run(["objects", "import", str(meshes), "--name", "mine", "--skip-bad", "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert "\x1b[31m" not in said
    assert "left out \\udcff.stl" in said


def test_names_beyond_ascii_are_kept(meshes: Path) -> None:
    for name in ("Größe 2.stl", "e\N{COMBINING ACUTE ACCENT}tui.stl", "茶碗.stl", "[bold]#1.stl"):
        (meshes / name).write_bytes(stl(block()))
    import_folder(meshes, "mine")
    models = load_object_set("mine")
    assert {model.object_id for model in models} == {"mine/Größe-2", "mine/étui", "mine/茶碗", "mine/-bold--1"}
    engine = connect()
    assert all(engine.loadURDF(str(model.urdf)) >= 0 for model in models)
    engine.disconnect()


def test_a_folder_without_meshes_tells_what_is_there(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("a.wrl", "b.wrl", "c.dae"):
        (meshes / name).write_text("")
    (line,) = refused(capsys, meshes)
    assert line.endswith("there are 2 .wrl, 1 .dae")
    (line,) = refused(capsys, meshes / "a.wrl")
    assert line.endswith("is a file, expected a folder of meshes")


@pytest.mark.parametrize("pattern", ["../*.stl", "a/../../*.stl", "**x"])
def test_a_pattern_that_leaves_the_folder_or_is_none(
    meshes: Path, capsys: pytest.CaptureFixture[str], pattern: str
) -> None:
    (meshes.parent / "secret.stl").write_bytes(stl(block()))
    (line,) = refused(capsys, meshes, "--pattern", pattern)
    assert line.startswith(f"error: pattern is {pattern!r}")


def test_plain_does_without_looks(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (meshes / "lost.mtl").write_text(LIBRARIES["lost.mtl"])
    (meshes / "lost.obj").write_bytes(pyramid("lost.mtl"))
    refused(capsys, meshes)
    assert run(["objects", "import", str(meshes), "--name", "mine", "--plain"]) == 0
    (model,) = load_object_set("mine")
    assert not (model.urdf.parent / "texture.png").exists()


def test_a_dry_run_tells_what_an_import_makes(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (meshes / "cube.stl").write_bytes(stl(block(0.05)))
    (meshes / "bad.stl").write_bytes(b"")
    words = ["objects", "import", str(meshes), "--name", "mine", "--skip-bad", "--density", "1000", "--json"]
    assert run([*words, "--dry-run"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert not cache_root().exists()
    assert run(words) == 0
    report = json.loads(capsys.readouterr().out)
    (planned,), (made,) = plan["objects"], report["objects"]
    assert planned["mass_kg"] == pytest.approx(0.125)
    assert planned["triangles"] == 12
    assert {key: planned[key] for key in ("name", "source", "size_m", "mass_kg")} == {
        key: made[key] for key in ("name", "source", "size_m", "mass_kg")
    }
    assert plan["folder"] == report["folder"]
    assert plan["skipped"] == report["skipped"] == [{"path": str(meshes / "bad.stl"), "reason": "the file is empty"}]
    assert run(["objects", "ls", "--json"]) == 0
    (listed,) = [one for one in json.loads(capsys.readouterr().out) if one["name"] == "mine"]
    assert (listed["objects"], listed["folder"]) == (1, report["folder"])


def test_pieces_that_look_inwards_are_turned_and_hollows_stay(meshes: Path) -> None:
    (meshes / "one-inverted.stl").write_bytes(stl(block() + inverted(block(x_m=0.0505))))
    (meshes / "all-inverted.stl").write_bytes(stl(inverted(block() + block(x_m=0.0505))))
    (meshes / "hollow.stl").write_bytes(stl(block(0.06) + inverted(block(0.04))))
    (meshes / "hollow-inverted.stl").write_bytes(stl(inverted(block(0.06) + inverted(block(0.04)))))
    masses = {one.name: one.mass_kg for one in plan_import(meshes, "mine").objects}
    solid, hollow = 2 * 0.05**3 * 400, (0.06**3 - 0.04**3) * 400
    expected = {"one-inverted": solid, "all-inverted": solid, "hollow": hollow, "hollow-inverted": hollow}
    assert masses == pytest.approx(expected, abs=1e-4)


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


def test_a_picture_that_changes_makes_another_set(meshes: Path) -> None:
    (meshes / "skin.mtl").write_text("newmtl m\nmap_Kd skin.bmp\n")
    (meshes / "skin.obj").write_bytes(pyramid("skin.mtl"))
    header = b"BM" + struct.pack("<IIIIIIHHIIIIII", 58, 0, 54, 40, 1, 1, 1, 24, 0, 4, 0, 0, 0, 0)
    (meshes / "skin.bmp").write_bytes(header + b"\x00\x00\xff\x00")
    plan = plan_import(meshes, "mine")
    assert [sorted(one.sha256) for one in plan.objects] == [["skin.bmp", "skin.mtl", "skin.obj"]]
    assert carry_out(plan).objects[0].source_sha256 == plan.objects[0].sha256["skin.obj"]
    assert plan_import(meshes, "mine").reused
    (meshes / "skin.bmp").write_bytes(header + b"\xff\x00\x00\x00")
    with pytest.raises(MeshImportError, match="made from other meshes or settings"):
        plan_import(meshes, "mine")


def test_a_mesh_that_changes_meanwhile_is_refused(meshes: Path) -> None:
    for name in ("a.stl", "b.stl"):
        (meshes / name).write_bytes(stl(block()))
    plan = plan_import(meshes, "mine")
    (meshes / "b.stl").write_bytes(stl(block(0.04)))
    with pytest.raises(MeshImportError, match=r"1 of 2 meshes(?s:.*)b\.stl: changed while it was imported"):
        carry_out(plan)
    assert list(cache_root().glob("imported/*")) == []


def test_a_folder_in_the_way_is_left_alone(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (meshes / "cube.stl").write_bytes(stl(block()))
    (cache_root() / "imported/mine").mkdir(parents=True)
    (cache_root() / "imported/mine/letter.txt").write_text("dear diary")
    (line,) = refused(capsys, meshes)
    assert line.endswith("exists and holds no object set; choose another name, or delete it first")


def test_what_coacd_cannot_cut_is_a_fault_and_the_next_mesh_is_cut() -> None:
    tangle = trimesh.creation.icosphere(subdivisions=3, radius=0.04)
    tangle.vertices += np.random.default_rng(0).normal(scale=0.01, size=tangle.vertices.shape)
    wild = trimesh.Trimesh(vertices=block().vertices, faces=block().faces + 10**7, process=False)
    with Cutter(limit_s=1) as cutter, pytest.raises(MeshFault, match="takes CoACD more than 1 s"):
        cutter.convex_parts(one_body(tangle))
    with Cutter() as cutter:
        with pytest.raises(MeshFault, match="makes CoACD crash"):
            cutter.convex_parts(one_body(wild))
        assert len(cutter.convex_parts(one_body(block()))) == 1


def one_body(mesh: trimesh.Trimesh) -> Solid:
    return Solid(surface=mesh, bodies=(mesh,))


def test_bodies_are_cut_one_by_one() -> None:
    """Together, two cubes with a narrow gap take CoACD minutes, and cubes that overlap many seconds."""
    for pair in (block() + block(x_m=0.0505), block() + block(x_m=0.03), block(0.06) + block(0.05)):
        with Cutter() as cutter:
            parts = cutter.convex_parts(make_solid(pair))
        assert len(parts) == 2
    hollow = make_solid(block(0.06) + inverted(block(0.04)))
    assert len(hollow.bodies) == 1
    assert hollow.volume_m3 == pytest.approx(0.06**3 - 0.04**3)


def test_ctrl_c_leaves_nothing_behind(
    meshes: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.stl", "b.stl"):
        (meshes / name).write_bytes(stl(block()))

    def interrupt(bar: Bar, count: int, total: int) -> None:
        del bar, total
        if list(cache_root().glob("imported/.mine-*/*/object.urdf")):
            assert count == 1
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Bar, "of", interrupt)
    assert run(["objects", "import", str(meshes), "--name", "mine"]) == 130
    assert capsys.readouterr().err == "interrupted: nothing was imported\n"
    assert list(cache_root().glob("imported/*")) == []
    monkeypatch.undo()


LIMITED_COMMAND = """
import resource
from handsight.cli.app import main
resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500))
main()
"""
"""A limit on files stands in for a full disk, as in the tests of collecting."""


def test_a_full_disk_and_a_cache_that_cannot_be_written(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (meshes / "cube.stl").write_bytes(stl(block()))
    words = ["objects", "import", str(meshes), "--name", "mine"]
    command = [sys.executable, "-P", "-c", LIMITED_COMMAND, *words]
    full = subprocess.run(command, check=False, capture_output=True, text=True, timeout=200)
    assert full.returncode == 2
    (line,) = full.stderr.splitlines()
    assert line.startswith("error: cannot write object set")
    assert "File too large" in line
    assert list(cache_root().glob("imported/*")) == []
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    assert run(words) == 2
    assert "Not a directory" in capsys.readouterr().err


def test_settings_that_no_manifest_could_hold(meshes: Path) -> None:
    (meshes / "cube.stl").write_bytes(stl(block()))
    with pytest.raises(MeshImportError, match=r"licence is .*expected printable text"):
        plan_import(meshes, "mine", settings=ImportSettings(licence=os.fsdecode(b"\xff")))
