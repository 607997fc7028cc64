"""Folders of meshes become object sets, whole or not at all."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from tests.support.meshes import block, cuboid, cup, refused_import, stl

from handsight.cli.app import run
from handsight.cli.output import Bar
from handsight.collection.errors import MeshImportError, ObjectSetError
from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.objects.cache import CACHE_VARIABLE, cache_root
from handsight.collection.sim.objects.catalogue import list_object_sets, load_object_set
from handsight.collection.sim.objects.meshes.importer import carry_out, import_folder
from handsight.collection.sim.objects.meshes.plan import ImportSettings, plan_import
from handsight.collection.sim.station import SimStation


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
    (line,) = refused_import(capsys, meshes)
    assert line.endswith("exists and holds no object set; choose another name, or delete it first")


def test_ctrl_c_leaves_nothing_behind(
    meshes: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.stl", "b.stl"):
        (meshes / name).write_bytes(stl(block()))

    def interrupt(bar: Bar, count: int, total: int) -> None:
        del bar, total
        if list(cache_root().glob("imported/.mine*/**/object.urdf")):
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
    assert "is a file, expected a folder" in capsys.readouterr().err


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


def test_importing_twice_changes_nothing(meshes: Path) -> None:
    cuboid().export(meshes / "cup.stl")
    first = import_folder(meshes, "cups")
    second = import_folder(meshes, "cups")
    assert (first.reused, second.reused) == (False, True)
    assert first.objects == second.objects
    trimesh.creation.box(extents=(0.05, 0.05, 0.05)).export(meshes / "cup.stl")
    with pytest.raises(MeshImportError, match="made from other meshes or settings"):
        import_folder(meshes, "cups")
    assert load_object_set("cups")[0].urdf.parent.parent == first.folder


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
    "nan.obj": "line 2: a vertex holds .nan., expected a finite number",
    "holes.ply": "is not watertight: .* edges do not join two triangles",
    "huge.stl": "has 327680 triangles, expected at most 100000",
    "units.stl": r"pass --scale 0\.001",
}


def test_all_bad_meshes_are_reported_and_nothing_is_written(meshes: Path) -> None:
    write_bad_meshes(meshes)
    cuboid().export(meshes / "good.stl")
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
    cuboid().export(meshes / "good.stl")
    report = import_folder(meshes, "mixed", skip_bad=True)
    assert [entry.name for entry in report.objects] == ["good"]
    assert {item.path.name for item in report.skipped} == set(FAULTS)
    assert len(load_object_set("mixed")) == 1


def test_only_bad_meshes_are_refused_even_on_request(meshes: Path) -> None:
    write_bad_meshes(meshes)
    with pytest.raises(MeshImportError, match="7 of 7 meshes"):
        import_folder(meshes, "mixed", skip_bad=True)


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
    cuboid().export(meshes / "cup.stl")
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
