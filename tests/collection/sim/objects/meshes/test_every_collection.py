"""The commands that docs/objects.md gives for known collections, on small copies of their layouts.

The meshes are generated; folders, names, kinds of file, textures and units are those of the collections.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from handsight.cli.app import run
from handsight.collection.sim.objects.cache import CACHE_VARIABLE
from handsight.collection.sim.objects.catalogue import load_object_set

DOCUMENT = Path(__file__).resolve().parents[5] / "docs/objects.md"
MILLIMETRES = 1000.0


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))


def shapes(scale: float = 1.0) -> list[trimesh.Trimesh]:
    """Five convex things of household size, in units of 1 m divided by ``scale``."""
    solids = [
        trimesh.creation.box(extents=(0.16, 0.21, 0.06)),
        trimesh.creation.cylinder(radius=0.033, height=0.1, sections=24),
        trimesh.creation.icosphere(subdivisions=2, radius=0.035),
        trimesh.creation.capsule(height=0.08, radius=0.02, count=[12, 12]),
        trimesh.creation.cone(radius=0.03, height=0.12, sections=20),
    ]
    for solid in solids:
        solid.apply_transform(np.diag([scale, scale, scale, 1.0]))
    return solids


def opened(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A scan with a hole."""
    mesh.update_faces(np.arange(len(mesh.faces)) > 2)
    return mesh


def write_textured(mesh: trimesh.Trimesh, path: Path, *, library: str, texture: str, decimals: int) -> None:
    """A Wavefront file whose faces name texture coordinates, with its material and texture files."""
    corners = [f"v {' '.join(f'{value:.{decimals}f}' for value in row)}" for row in mesh.vertices]
    around = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0]) / (2 * np.pi) + 0.5
    coordinates = [f"vt {value:.4f} 0.5" for value in around]
    faces = ["f " + " ".join(f"{corner + 1}/{corner + 1}" for corner in face) for face in mesh.faces]
    lines = [f"mtllib {library}", *corners, *coordinates, "usemtl material_0", *faces]
    path.write_text("\n".join(lines) + "\n")
    (path.parent / library).write_text(f"newmtl material_0\nKd 0.639216 0.639216 0.639216\nmap_Kd {texture} \n")
    Image.new("RGB", (512, 512), (200, 30, 30)).save(path.parent / texture)


def ycb(home: Path) -> None:
    names = ("003_cracker_box", "005_tomato_soup_can", "055_baseball", "011_banana", "013_apple")
    for name, mesh in zip(names, shapes(), strict=True):
        folder = home / "ycb" / name / "google_16k"
        folder.mkdir(parents=True)
        write_textured(mesh, folder / "textured.obj", library="textured.mtl", texture="texture_map.png", decimals=6)
        mesh.export(folder / "nontextured.ply")
        mesh.export(folder / "nontextured.stl")
        (folder / "kinbody.xml").write_text("<KinBody/>")
        (home / "ycb" / name / "tsdf").mkdir()
        opened(mesh).export(home / "ycb" / name / "tsdf" / "nontextured.ply")
    (home / "ycb" / "072-a_toy_airplane" / "google_16k").mkdir(parents=True)
    write_textured(
        opened(shapes()[0]),
        home / "ycb" / "072-a_toy_airplane" / "google_16k" / "textured.obj",
        library="textured.mtl",
        texture="texture_map.png",
        decimals=6,
    )


def kit(home: Path) -> None:
    names = ("Amicelli", "BlueSaltCube", "ChocoIcing", "Glue", "YellowSaltCube2")
    for name, mesh in zip(names, shapes(MILLIMETRES), strict=True):
        folder = home / "kit" / name
        folder.mkdir(parents=True)
        for size in ("800", "5k", "25k"):
            stem = f"{name}_{size}_tex"
            write_textured(mesh, folder / f"{stem}.obj", library=f"{stem}.mtl", texture=f"{stem}.png", decimals=3)
        mesh.export(folder / f"{name}_Orig.obj")
        (folder / f"{name}_5k.wrl").write_text("#VRML V2.0 utf8\n")


def egad(home: Path) -> None:
    for part, names in (
        ("train", ("00_00", "04_12", "13_22", "24_00", "25_19")),
        ("eval", ("A0", "B3", "D4", "F1", "G6")),
    ):
        folder = home / "egad" / f"egad_{part}_set"
        (folder / "processed_meshes").mkdir(parents=True)
        for name, mesh in zip(names, shapes(MILLIMETRES), strict=True):
            mesh.export(folder / f"{name}.obj")
            mesh.export(folder / "processed_meshes" / f"{name}.obj")


def three_d_net(home: Path) -> None:
    digests = (
        "1c3fccb84f1eeb97a3d0a41d6c77ec7c",
        "2fd962520fba59e738863d75c524682",
        "46955fddcc83a50f79b586547e543694",
    )
    names = (*digests, "5582a89be131867846ebf4f1147c3f0f", "a1d293f5cc20d01ad7f470ee20dce9e0")
    for category in ("mug", "hammer"):
        folder = home / "3dnet/Cat10_ModelDatabase" / category
        folder.mkdir(parents=True)
        for name, mesh in zip(names, shapes(10.0), strict=True):
            mesh.export(folder / f"{name}.ply", encoding="ascii")
        opened(shapes(10.0)[1]).export(folder / "6683cadf1d45d69a3a3cbcf1ae739c36.ply", encoding="ascii")


LAYOUTS: dict[str, Callable[[Path], None]] = {
    "ycb": ycb,
    "kit": kit,
    "egad-train": egad,
    "egad-eval": egad,
    "3dnet-mug": three_d_net,
}
FIRST_NAMES = {
    "ycb": "003_cracker_box",
    "kit": "Amicelli_5k_tex",
    "egad-train": "00_00",
    "egad-eval": "A0",
    "3dnet-mug": "1c3fccb84f1eeb97a3d0a41d6c77ec7c",
}
OPEN = {"ycb": ["072-a_toy_airplane"], "3dnet-mug": ["6683cadf1d45d69a3a3cbcf1ae739c36"]}


def documented_commands() -> Iterator[tuple[str, list[str]]]:
    """Every import of a known collection in the document: the name of the set, and the arguments."""
    for block in re.findall(r"^```sh\n(.*?)^```", DOCUMENT.read_text(), re.MULTILINE | re.DOTALL):
        for line in block.splitlines():
            words = shlex.split(line)[1:]
            if words[:2] == ["objects", "import"] and words[words.index("--name") + 1] != "mine":
                yield words[words.index("--name") + 1], words


def json_of(capsys: pytest.CaptureFixture[str], words: list[str]) -> Any:
    assert run([*words, "--json"]) == 0, capsys.readouterr().err
    return json.loads(capsys.readouterr().out)


def test_every_documented_collection_is_tried() -> None:
    assert {name for name, _ in documented_commands()} == LAYOUTS.keys() == FIRST_NAMES.keys()


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_collection_from_its_folder_to_attempts(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    LAYOUTS[name](tmp_path)
    words = [word.replace("~", str(tmp_path)) for word in dict(documented_commands())[name]]
    plan = json_of(capsys, [*words, "--dry-run"])
    report = json_of(capsys, words)
    assert [one["name"] for one in plan["objects"]] == [one["name"] for one in report["objects"]]
    assert report["objects"][0]["name"] == FIRST_NAMES[name]
    # The first shape stands in all collections at its size in metres.
    assert sorted(report["objects"][0]["size_m"]) == pytest.approx([0.06, 0.16, 0.21], abs=2e-4)
    assert len(report["objects"]) == 5
    reasons = {Path(one["path"]).relative_to(tmp_path).as_posix(): one["reason"] for one in report["skipped"]}
    assert len(reasons) == len(OPEN.get(name, []))
    for path, reason in reasons.items():
        assert any(stem in path for stem in OPEN[name])
        assert reason.startswith("is not watertight")
    textured = name in ("ycb", "kit")
    assert {one["textured"] for one in plan["objects"]} == {textured}
    assert all((model.urdf.parent / "texture.png").exists() == textured for model in load_object_set(name))
    collected = json_of(
        capsys, ["collect", "sim", str(tmp_path / "grasps"), "--objects", name, "-n", "3", "-w", "1", "--seed", "1"]
    )
    assert collected["attempts"] == 3
    objects = json_of(capsys, ["dataset", "ls", str(tmp_path / "grasps"), "--limit", "0"])
    assert {row["outcome"] for row in objects} <= {"held", "empty"}
