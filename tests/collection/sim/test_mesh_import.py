"""Folders of meshes that a user brings: what becomes of good ones, and what is said about bad ones."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from handsight.collection.errors import MeshImportError, ObjectSetError
from handsight.collection.sim.bullet import BulletClient, connect
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.objects import list_object_sets, load_object_set
from handsight.collection.sim.objects.cache import CACHE_VARIABLE, cache_root
from handsight.collection.sim.objects.meshes.finding import find_meshes, object_names
from handsight.collection.sim.objects.meshes.importer import import_folder
from handsight.collection.sim.objects.meshes.plan import ImportSettings
from handsight.collection.sim.station import SimStation


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    folder = tmp_path / "meshes"
    folder.mkdir()
    return folder


@pytest.fixture
def engine() -> Iterator[BulletClient]:
    bullet = connect()
    yield bullet
    bullet.disconnect()


def cup() -> trimesh.Trimesh:
    """A closed, concave beaker: 60 mm wide, 50 mm high, walls 8 mm."""
    profile = np.array([(0, 0), (30, 0), (30, 50), (22, 50), (22, 8), (0, 8)]) * 1e-3
    solid: trimesh.Trimesh = trimesh.creation.revolve(profile, sections=16)
    return solid


def block() -> trimesh.Trimesh:
    """A cuboid: cut into its one part at once, where the beaker takes seconds."""
    solid: trimesh.Trimesh = trimesh.creation.box(extents=(0.06, 0.05, 0.04))
    return solid


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "glb"])
def test_every_kind_of_file_becomes_an_object(bullet: BulletClient, meshes: Path, suffix: str) -> None:
    trimesh.creation.box(extents=(0.06, 0.04, 0.03)).export(meshes / f"block.{suffix}")
    settings = ImportSettings(density_kg_m3=500, licence="CC-BY-4.0", friction=0.6)
    report = import_folder(meshes, "mine", settings=settings)
    (entry,) = report.objects
    assert (entry.name, entry.source, entry.licence) == ("block", f"block.{suffix}", "CC-BY-4.0")
    assert entry.mass_kg == pytest.approx(0.06 * 0.04 * 0.03 * 500)
    assert entry.size_m == pytest.approx((0.06, 0.04, 0.03), abs=1e-4)
    (model,) = load_object_set("mine")
    assert model.object_id == "mine/block"
    body = bullet.loadURDF(str(model.urdf), globalScaling=model.scale)
    mass_kg, friction, *_ = bullet.getDynamicsInfo(body, -1)
    assert (mass_kg, friction) == pytest.approx((entry.mass_kg, 0.6))
    low, high = np.array(bullet.getAABB(body))
    # Bullet adds a margin of 3 mm around a box in its broad phase.
    assert high - low == pytest.approx(entry.size_m, abs=0.008)


def test_a_hollow_survives_the_decomposition(bullet: BulletClient, meshes: Path) -> None:
    cup().export(meshes / "cup.ply")
    import_folder(meshes, "cups")
    (model,) = load_object_set("cups")
    bullet.loadURDF(str(model.urdf))
    ((body, _, _, position, _),) = bullet.rayTest((0, 0, 0.1), (0, 0, -0.1))
    assert body >= 0
    # The centre of mass is below the middle: a lid would be 25 mm and more above it, the floor is below.
    assert position[2] < 0
    text = (model.urdf.parent / "collision.obj").read_text()
    assert 2 <= text.count("o convex_") <= 12


def test_importing_twice_changes_nothing(meshes: Path) -> None:
    block().export(meshes / "cup.stl")
    first = import_folder(meshes, "cups")
    second = import_folder(meshes, "cups")
    assert (first.reused, second.reused) == (False, True)
    assert first.objects == second.objects
    trimesh.creation.box(extents=(0.05, 0.05, 0.05)).export(meshes / "cup.stl")
    with pytest.raises(MeshImportError, match="made from other meshes or settings"):
        import_folder(meshes, "cups")
    assert load_object_set("cups")[0].urdf.parent.parent == first.folder


def test_a_decomposition_has_the_same_bytes_again(meshes: Path) -> None:
    pair = block()
    pair.apply_translation((0.0605, 0, 0))
    pair += block()
    pair.export(meshes / "pair.stl")
    first, second = (import_folder(meshes, name) for name in ("one", "two"))
    assert first.objects[0].sha256 == second.objects[0].sha256


def test_millimetres_become_metres(meshes: Path) -> None:
    mesh = block()
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


def write_bad_meshes(folder: Path) -> None:
    (folder / "empty.stl").write_bytes(b"")
    (folder / "garbage.glb").write_bytes(b"no mesh at all")
    (folder / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    (folder / "nan.obj").write_text("v 0 0 0\nv nan 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n")
    opened = cup()
    opened.update_faces(np.arange(len(opened.faces)) > 3)
    opened.export(folder / "holes.ply")
    trimesh.creation.icosphere(subdivisions=7, radius=0.03).export(folder / "huge.stl")
    trimesh.creation.box(extents=(80, 60, 40)).export(folder / "units.stl")


FAULTS = {
    "empty.stl": "the file is empty",
    "garbage.glb": "cannot be read",
    "points.obj": "has no triangles|cannot be read",
    "nan.obj": "1 of 4 vertices are not finite",
    "holes.ply": "is not watertight: .* edges do not join two triangles",
    "huge.stl": "has 327680 triangles, expected at most 100000",
    "units.stl": r"pass --scale 0\.001",
}


def test_all_bad_meshes_are_reported_and_nothing_is_written(meshes: Path) -> None:
    write_bad_meshes(meshes)
    block().export(meshes / "good.stl")
    with pytest.raises(MeshImportError) as caught:
        import_folder(meshes, "mixed")
    message = str(caught.value)
    assert message.startswith("7 of 8 meshes")
    assert "--skip-bad" in message
    for name, fault in FAULTS.items():
        (line,) = [line for line in message.splitlines() if line.strip().startswith(f"{name}:")]
        assert re.search(fault, line), line
    assert not cache_root().exists()


def test_bad_meshes_are_left_out_on_request(meshes: Path) -> None:
    write_bad_meshes(meshes)
    block().export(meshes / "good.stl")
    report = import_folder(meshes, "mixed", skip_bad=True)
    assert [entry.name for entry in report.objects] == ["good"]
    assert {item.path.name for item in report.skipped} == set(FAULTS)
    assert len(load_object_set("mixed")) == 1


def test_only_bad_meshes_are_refused_even_on_request(meshes: Path) -> None:
    write_bad_meshes(meshes)
    with pytest.raises(MeshImportError, match="7 of 7 meshes"):
        import_folder(meshes, "mixed", skip_bad=True)


def test_an_inside_out_mesh_is_turned(meshes: Path) -> None:
    mesh = block()
    mesh.invert()
    mesh.export(meshes / "cup.stl")
    (entry,) = import_folder(meshes, "cups").objects
    assert entry.mass_kg == pytest.approx(0.06 * 0.05 * 0.04 * 400)


def test_wrong_arguments_are_all_reported(meshes: Path) -> None:
    settings = ImportSettings(scale=0.0, density_kg_m3=float("nan"))
    with pytest.raises(MeshImportError) as caught:
        import_folder(meshes / "nowhere", "a b", settings=settings)
    for fault in ("scale is 0", "density_kg_m3 is nan", "set name is 'a b'", "is missing, expected a folder"):
        assert fault in str(caught.value)


@pytest.mark.parametrize("pattern", ["", "/tmp/*"])
def test_a_pattern_stays_in_the_folder(meshes: Path, pattern: str) -> None:
    with pytest.raises(MeshImportError, match="expected a pattern below the folder"):
        import_folder(meshes, "mine", settings=ImportSettings(pattern=pattern))


@pytest.mark.parametrize("name", ["household-train", "../up", ".hidden", ""])
def test_a_set_cannot_take_such_a_name(meshes: Path, name: str) -> None:
    block().export(meshes / "cup.stl")
    with pytest.raises(MeshImportError, match="set name"):
        import_folder(meshes, name)


def test_an_empty_folder_and_a_file_are_refused(meshes: Path, tmp_path: Path) -> None:
    with pytest.raises(MeshImportError, match="holds no mesh that matches"):
        import_folder(meshes, "none")
    (tmp_path / "file.stl").write_text("")
    with pytest.raises(MeshImportError, match="is a file, expected a folder"):
        import_folder(tmp_path / "file.stl", "none")


def test_names_leave_out_what_all_paths_share(meshes: Path) -> None:
    for name in ("025_mug", "006 mustard"):
        (meshes / name / "google_16k").mkdir(parents=True)
        block().export(meshes / name / "google_16k" / "textured.obj")
    paths = find_meshes(meshes, "*/google_16k/textured.obj")
    assert object_names(meshes, paths) == ["006-mustard", "025_mug"]


def test_two_files_of_one_name_are_a_fault(meshes: Path) -> None:
    block().export(meshes / "cup.stl")
    block().export(meshes / "cup.ply")
    with pytest.raises(MeshImportError, match=r"gives object 'cup' a second time"):
        import_folder(meshes, "cups")
    assert len(import_folder(meshes, "cups", settings=ImportSettings(pattern="*.ply")).objects) == 1


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


def test_an_imported_set_is_listed_and_dropped(meshes: Path) -> None:
    for number, height in enumerate((0.03, 0.04, 0.05, 0.06, 0.07)):
        trimesh.creation.box(extents=(0.04, 0.06, height)).export(meshes / f"box{number}.stl")
    report = import_folder(meshes, "boxes")
    (info,) = [info for info in list_object_sets() if info.folder is not None]
    assert (info.name, info.objects, info.folder) == ("boxes", 5, report.folder)
    station = SimStation(SimConfig(objects=str(report.folder)))
    try:
        scene = station.reset(np.random.default_rng(0))
    finally:
        station.close()
    assert (scene.pose_base_object[:, 2] > 0.01).all()


def test_a_damaged_import_is_refused(meshes: Path) -> None:
    block().export(meshes / "cup.stl")
    report = import_folder(meshes, "cups")
    (report.folder / "cup" / "collision.obj").write_text("")
    with pytest.raises(ObjectSetError, match="is damaged: cup has SHA-256"):
        load_object_set("cups")
    (report.folder / "manifest.json").write_text("{")
    (info,) = [info for info in list_object_sets() if info.folder is not None]
    assert info.objects == 0
    assert "cannot be read" in info.description


def test_progress_counts_the_meshes(meshes: Path) -> None:
    for name in ("a", "b"):
        trimesh.creation.box(extents=(0.04, 0.04, 0.04)).export(meshes / f"{name}.stl")
    seen: list[tuple[int, int]] = []
    import_folder(meshes, "boxes", progress=lambda done, total: seen.append((done, total)))
    assert seen == [(1, 2), (2, 2)]
