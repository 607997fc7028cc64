"""Wavefront files whose materials and pictures lie elsewhere, several to a file, or scaled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tests.support.meshes import pyramid, refused_import

from handsight.cli.app import run
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.objects.meshes.mesh_file import CheckedMesh, check_mesh


def coordinates(mesh: CheckedMesh) -> list[list[float]]:
    visual: Any = mesh.looks.visual
    return [[float(value) for value in row] for row in np.unique(visual.uv, axis=0)]


def picture(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (4, 4), (200, 30, 30)).save(path)


def test_pictures_in_a_folder_above_are_taken_from_the_folder_that_is_imported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The layout of robosuite's assets: meshes and pictures in folders side by side."""
    assets = tmp_path / "assets"
    inner = assets / "objects" / "meshes"
    picture(assets / "textures" / "bread.png")
    inner.mkdir(parents=True)
    (inner / "bread.mtl").write_text("newmtl m\nmap_Kd ../../textures/bread.png\n")
    (inner / "bread.obj").write_bytes(pyramid("bread.mtl"))
    refusal = " ".join(refused_import(capsys, inner))
    assert "names '../../textures/bread.png', which is outside the folder" in refusal
    assert f"import {assets} with --pattern 'objects/meshes/**/*'" in refusal
    assert run(["objects", "import", str(assets), "--name", "mine", "--pattern", "objects/meshes/**/*"]) == 0
    (model,) = load_object_set("mine")
    assert (model.urdf.parent / "texture.png").is_file()


def test_no_import_is_proposed_that_would_read_what_is_no_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    inner = tmp_path / "meshes"
    inner.mkdir()
    (tmp_path / "secret").write_text("secret")
    (inner / "one.mtl").write_text("newmtl m\nmap_Kd ../secret\n")
    (inner / "one.obj").write_bytes(pyramid("one.mtl"))
    assert "--pattern" not in " ".join(refused_import(capsys, inner))


@pytest.mark.parametrize("options", ["", "-s 1 1 1 ", "-clamp on -bm 0.5 "])
def test_options_before_a_picture_are_no_part_of_its_name(meshes: Path, options: str) -> None:
    picture(meshes / "t.png")
    (meshes / "one.mtl").write_text(f"newmtl m\nmap_Kd {options}t.png\n")
    (meshes / "one.obj").write_bytes(pyramid("one.mtl"))
    mesh = check_mesh(meshes / "one.obj", root=meshes, scale=1.0)
    assert {path.name for path in mesh.sha256} == {"one.obj", "one.mtl", "t.png"}
    assert coordinates(mesh) == [[0, 0], [0, 1], [1, 0]]


def test_scale_and_offset_move_the_coordinates(meshes: Path) -> None:
    picture(meshes / "t.png")
    (meshes / "one.mtl").write_text("newmtl m\nmap_Kd -o 0.5 0.25 -s 2 3 t.png\n")
    (meshes / "one.obj").write_bytes(pyramid("one.mtl"))
    mesh = check_mesh(meshes / "one.obj", root=meshes, scale=1.0)
    assert coordinates(mesh) == [[0.5, 0.25], [0.5, 3.25], [2.5, 0.25]]


@pytest.mark.parametrize("naming", ["mtllib a.mtl b.mtl", "mtllib a.mtl\nmtllib b.mtl", "mtllib two words.mtl"])
def test_libraries_are_found_however_many_stand_on_a_line(meshes: Path, naming: str) -> None:
    picture(meshes / "t.png")
    (meshes / "a.mtl").write_text("newmtl other\nKd 1 0 0\n")
    for name in ("b.mtl", "two words.mtl"):
        (meshes / name).write_text("newmtl m\nmap_Kd t.png\n")
    (meshes / "one.obj").write_bytes(f"# mtllib none.mtl\n{naming}\n".encode() + pyramid())
    assert "t.png" in {path.name for path in check_mesh(meshes / "one.obj", root=meshes, scale=1.0).sha256}


def test_a_library_that_makes_no_sense_is_named_with_its_line(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (meshes / "one.mtl").write_text("newmtl m\nKd nan 0 0\n")
    (meshes / "one.obj").write_bytes(pyramid("one.mtl"))
    _, line = refused_import(capsys, meshes)
    assert "one.obj: names 'one.mtl', which is wrong in line 2: Kd holds 'nan'" in line
