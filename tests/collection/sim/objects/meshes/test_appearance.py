"""Textures and colours of imported meshes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from tests.support.meshes import pyramid, refused_import

from handsight.cli.app import run
from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.objects.meshes.importer import import_folder


def test_plain_does_without_looks(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (meshes / "lost.mtl").write_text("newmtl m\nmap_Kd gone.png\n")
    (meshes / "lost.obj").write_bytes(pyramid("lost.mtl"))
    refused_import(capsys, meshes)
    assert run(["objects", "import", str(meshes), "--name", "mine", "--plain"]) == 0
    (model,) = load_object_set("mine")
    assert not (model.urdf.parent / "texture.png").exists()


def painted(vertices: int, colour: tuple[int, int, int]) -> Any:
    """A texture of one colour, larger than is kept."""
    # trimesh's classes of looks carry no annotations.
    visual: Any = trimesh.visual
    material = visual.material.SimpleMaterial(image=Image.new("RGB", (600, 300), colour))
    return visual.TextureVisuals(uv=np.full((vertices, 2), 0.5), material=material)


def test_a_texture_and_a_colour_are_kept(bullet: BulletClient, meshes: Path) -> None:
    box = trimesh.creation.box(extents=(0.05, 0.05, 0.05))
    textured = trimesh.Trimesh(
        vertices=box.vertices,
        faces=box.faces,
        visual=painted(len(box.vertices), (10, 200, 30)),
    )
    textured.export(meshes / "green.glb")
    red = box.copy()
    red.visual.vertex_colors = np.array([220, 20, 20, 255], np.uint8)
    red.export(meshes / "red.ply")
    import_folder(meshes, "boxes")
    green_model, red_model = load_object_set("boxes")
    assert rendered_colour(bullet, green_model.urdf) == "green"
    assert rendered_colour(bullet, red_model.urdf) == "red"


def rendered_colour(bullet: BulletClient, urdf: Path) -> str:
    bullet.resetSimulation()
    bullet.loadURDF(str(urdf))
    view = bullet.computeViewMatrix((0.1, 0.1, 0.2), (0, 0, 0), (0, 0, 1))
    lens = bullet.computeProjectionMatrixFOV(40, 1, 0.01, 1)
    picture = bullet.getCameraImage(64, 64, view, lens, renderer=bullet.ER_TINY_RENDERER)
    centre = np.reshape(picture[2], (64, 64, 4))[32, 32, :3]
    return ("red", "green", "blue")[int(np.argmax(centre))]
